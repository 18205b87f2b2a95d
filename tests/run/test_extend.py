"""`extend=true` goes on from a finished run: its curve, bits, schedule and refusals, by the real command."""

import json
import shutil
from collections.abc import Callable
from functools import cache
from pathlib import Path
from tempfile import mkdtemp

import pandas as pd
import pytest

from ship_trl.files.record import RunRecord, read_whole
from tests.command import contents
from tests.forked import Ended, run
from tests.test_faults import ALONE, KILLED, SHORT, TRANSFER, die_at, new_folder

FOLDER = Path("outputs/smoke/near/scratch/seed=0")
LONGER = ("learn.episodes=7", "extend=true")
# Copied layers thaw to the end, so that a longer schedule freezes some of them again.
THAWING = (*SHORT, "source=near", "target=met", "arm=GU3", "transfer.unfreeze.period=1")
LINES = {"scratch": ALONE, "transfer": TRANSFER, "thawing": THAWING, "rollouts": (*ALONE, "algorithm=ppo")}
PLACES = {
    "transfer": Path("outputs/smoke/near-met/FT3/seed=0"),
    "thawing": Path("outputs/smoke/near-met/GU3/seed=0"),
}


def with_words(words: tuple[str, ...], *changes: str) -> tuple[str, ...]:
    """Return a command with other values of some keys."""
    keys = {change.partition("=")[0] for change in changes}
    return (*(word for word in words if word.partition("=")[0] not in keys), *changes)


def train(folder: Path, *words: str) -> Ended:
    ended = run(*words, folder=folder)
    assert ended.code == 0 and "Traceback" not in ended.err, ended
    return ended


@cache
def finished(*lines: tuple[str, ...]) -> Path:
    """Return the folder in which commands have been run one after the other."""
    folder = new_folder(Path(mkdtemp(prefix="extend-")))
    if before := lines[:-1]:
        shutil.copytree(finished(*before), folder, dirs_exist_ok=True)
    train(folder, *lines[-1])
    return folder


def extended(words: tuple[str, ...] = ALONE) -> Path:
    """Return the folder of a run of three episodes that was extended to seven."""
    return finished(words, with_words(words, *LONGER))


def copied(folder: Path, place: Path) -> Path:
    """Return a copy of a folder, to train in."""
    return shutil.copytree(folder, place / "copy")


def read(folder: Path, place: Path = FOLDER) -> RunRecord:
    return read_whole(folder / place)


@pytest.mark.parametrize(
    "name", ["scratch", *(pytest.param(n, marks=pytest.mark.long) for n in LINES if n != "scratch")]
)
def test_the_curve_goes_on_and_twice_gives_the_same_bytes(name: str, tmp_path: Path) -> None:
    words, place = LINES[name], PLACES.get(name, FOLDER)
    before, after = finished(words), extended(words)
    first, longer = ((folder / place / "curve.csv").read_text() for folder in (before, after))
    assert longer.startswith(first) and longer != first
    one, other = read(before, place), read(after, place)
    assert (one.episodes, one.extended, other.episodes, other.extended) == (3, [], 7, [3])
    assert other.steps > one.steps and other.config_hash != one.config_hash
    assert (other.before, other.untrained) == (one.before, one.untrained)
    assert other.training.episode.tolist() == [*range(1, 8)]
    assert other.greedy.episode.tolist() == [0, 2, 3, 4, 6, 7]
    # Its source is that of the first run.
    assert (one.source_network or "").split("/")[-2:] == (other.source_network or "").split("/")[-2:]
    again = copied(before, tmp_path)
    assert "extending the run of 3 episodes to 7" in train(again, *with_words(words, *LONGER)).out
    assert contents(again) == contents(after)


@pytest.mark.parametrize(
    ("name", "steps"),
    [
        ("scratch", (4, 30)),
        *(pytest.param(name, (8, 41), marks=pytest.mark.long) for name in LINES if name != "scratch"),
        *(pytest.param("scratch", (step,), marks=pytest.mark.long) for step in range(1, 73, 8)),
    ],
)
def test_a_killed_extension_resumes(name: str, steps: tuple[int, ...], tmp_path: Path) -> None:
    words = LINES[name]
    folder, line = copied(finished(words), tmp_path), with_words(words, *LONGER)
    for step in steps:
        assert run(*line, folder=folder, before=die_at(step)).code in (KILLED, 0)
    train(folder, *line)
    assert contents(folder) == contents(extended(words))


def test_once_more_it_is_finished_and_can_be_extended_again(tmp_path: Path) -> None:
    folder = copied(extended(), tmp_path)
    before = contents(folder)
    assert "is already finished" in train(folder, *with_words(ALONE, *LONGER)).out
    assert contents(folder) == before
    train(folder, *with_words(ALONE, "learn.episodes=9", "extend=true"))
    assert read(folder).extended == [3, 7] and read(folder).episodes == 9


def test_the_schedule_is_that_of_the_longer_run() -> None:
    """It was at its end, and goes back to what a run of seven episodes has at the present one."""
    whole = read(finished(with_words(ALONE, LONGER[0]))).training
    first, longer = read(finished(ALONE)).training, read(extended()).training
    assert longer.epsilon[:3].tolist() == first.epsilon.tolist()
    assert longer.epsilon[3:].tolist() == whole.epsilon[3:].tolist()
    assert longer.epsilon[3] > longer.epsilon[2]


def test_of_episodes_that_end_together_none_is_counted_twice() -> None:
    words = with_words(ALONE, "learn.num_envs=4")
    after = extended(words) / FOLDER
    lengths = pd.read_csv(after / "curve.csv")["length"].dropna()
    # Three of the first four count, and all last ten steps at most.
    assert len(lengths) == 7 and lengths.max() <= 10


def test_a_grid_is_extended_and_its_results_are_of_the_longer_runs(tmp_path: Path) -> None:
    words = ("-m", *ALONE, "hydra/launcher=basic", "seed=0,1")
    folder = copied(finished(ALONE), tmp_path)
    train(folder, *words)
    line = with_words(words, *LONGER)
    # The first run is extended, the second not yet.
    train(folder, *with_words(ALONE, *LONGER))
    train(folder, *line)
    assert [read(folder, FOLDER.with_name(f"seed={k}")).extended for k in (0, 1)] == [[3], [3]]
    # In tables they are like a run that had as many episodes from the start.
    train(folder, *with_words(ALONE, "learn.episodes=7", "seed=2"))
    assert "\n| smoke/near scratch | 3 |" in train(folder, "results", "outputs", "--markdown").out
    before = contents(folder)
    ended = run(*with_words(line, "learn.episodes=9", "seed=0,3"), folder=folder)
    assert ended.is_refusal and "seed=3 holds no finished run" in ended.err, ended
    assert contents(folder) == before


def damaged(folder: Path) -> None:
    path = folder / FOLDER / "checkpoint.safetensors"
    data = bytearray(path.read_bytes())
    data[-1000] ^= 1
    path.write_bytes(data)


def unfinished(folder: Path) -> None:
    assert run(*with_words(ALONE, *LONGER), folder=folder, before=die_at(40)).code == KILLED


REFUSED: dict[str, tuple[Callable[[Path], object] | None, str]] = {
    "learn.episodes=3 extend=true": (
        None,
        "learn.episodes: must be more than 3 with extend=true, which outpu",
    ),
    "learn.episodes=2 extend=true": (
        None,
        "learn.episodes: must be more than 3 with extend=true, which outpu",
    ),
    "learn.episodes=7 extend=true learn.lr=0.01": (
        None,
        "extend: outputs/smoke/near/scratch/seed=0 holds a finished run of other settings (learn.lr=0.0001)",
    ),
    "learn.episodes=7 extend=true seed=5": (
        None,
        "extend: outputs/smoke/near/scratch/seed=5 holds no finished run; allowed: extend=false, which",
    ),
    "learn.episodes=7 extend=true learn.backend=dense": (
        None,
        "checkpoint.safetensors, episode 3, was computed by",
    ),
    "learn.episodes=7 extend=true ": (
        lambda folder: (folder / FOLDER / "checkpoint.safetensors").unlink(),
        "holds no checkpoint.safetensors of its end; allowed: a run trained with checkpoint.keep=true and",
    ),
    "learn.episodes=7  extend=true": (damaged, "checkpoint.safetensors is damaged; allowed: a whole one"),
    "learn.episodes=8 extend=true": (
        unfinished,
        "holds an unfinished run of other settings (learn.episodes=7",
    ),
    "learn.episodes=3": (unfinished, "holds an unfinished run of other settings (learn.episodes=7)"),
    "learn.episodes=7": (
        lambda folder: train(folder, *with_words(ALONE, *LONGER)),
        "holds a finished run of other settings, extended at episode 3; allowed: another output=FOLDER, or",
    ),
}


@pytest.mark.parametrize("words", REFUSED)
def test_it_is_refused_in_one_line_and_nothing_is_lost(words: str, tmp_path: Path) -> None:
    spoil, told = REFUSED[words]
    folder = copied(finished(ALONE), tmp_path)
    if spoil is not None:
        spoil(folder)
    before = contents(folder)
    ended = run(*with_words(ALONE, *words.split()), folder=folder)
    assert ended.is_refusal and ended.err.count("\n") == 1 and told in ended.err, ended
    assert contents(folder) == before


def test_an_extension_that_is_given_up_leaves_the_finished_run(tmp_path: Path) -> None:
    folder = copied(finished(ALONE), tmp_path)
    unfinished(folder)
    assert not (folder / FOLDER / "result.json").exists()
    train(folder, *ALONE, "overwrite=true")
    before, after = contents(finished(ALONE)), contents(folder)
    assert after.pop(f"{FOLDER}/config.yaml") != before.pop(f"{FOLDER}/config.yaml")
    assert after == before


def test_without_a_checkpoint_of_the_end_a_run_is_smaller(tmp_path: Path) -> None:
    folder = copied(finished(ALONE), tmp_path)
    train(folder, *with_words(ALONE, *LONGER, "checkpoint.keep=false"))
    assert not (folder / FOLDER / "checkpoint.safetensors").exists()
    assert json.loads((folder / FOLDER / "result.json").read_text())["extended"] == [3]
    train(folder, *with_words(ALONE, *LONGER))
