"""A stopped training resumes and ends with the same bits as an uninterrupted one."""

import json
import re
import shutil
import signal
from collections.abc import Callable
from pathlib import Path
from typing import Any, cast

import pytest
import torch

from ship_trl.config.errors import ConfigError
from ship_trl.files.curve import read_curve
from ship_trl.learn.double_dqn import DoubleDQN
from ship_trl.run import checkpoint, experiment
from ship_trl.run.checkpoint import NAMES, read_newest
from ship_trl.run.experiment import run_experiment
from ship_trl.run.header import About
from ship_trl.run.plan import CHECKPOINTS, LAST_CHECKPOINT, TakenError, make_run
from ship_trl.run.process import StoppedError
from ship_trl.run.setup import Parts
from ship_trl.run.trackers import Trackers
from tests.command import files
from tests.config.test_config import composed
from tests.pictures import OF_RUNS

LINE = (
    *("profile=smoke", "learn.episodes=9", "learn.replay_size=150", "learn.jumpstart_draws=1"),
    *("learn.batch_size=8", "checkpoint.every=0", "checkpoint.seconds=0"),
)
# The paper's layers with few filters, for checkpoints of a megabyte in place of fourteen.
SMALL = ("network.conv=[[8,8,4],[8,4,2],[8,3,1],[20,7,1]]", "network.hidden=20")
SCRATCH = ("target=4", "method=scratch", *SMALL)


@pytest.fixture
def after(monkeypatch: pytest.MonkeyPatch) -> Callable[[int, Callable[[], Any]], None]:
    """Call a function when a training has logged a number of events."""

    def happen(events: int, act: Callable[[], Any]) -> None:
        log, seen = Trackers.log, 0

        def counted(tracker: Trackers, event: Any) -> None:
            nonlocal seen
            log(tracker, event)
            seen += 1
            if seen == events:
                act()

        monkeypatch.setattr(Trackers, "log", counted)

    return happen


def train(folder: str, *overrides: str) -> Path:
    run = make_run(composed(*LINE, f"output={folder}", *overrides))
    run_experiment(run)
    return run.folder


def left(folder: Path) -> dict[str, Any]:
    """Return the files of a run, without its time and the names of folders."""
    found: dict[str, Any] = files(folder)
    del found["config.yaml"]
    result = json.loads(found["result.json"])
    return found | {
        "result.json": {k: v for k, v in result.items() if k not in ("seconds", "source_network")}
    }


def newest_checkpoint(folder: Path) -> About:
    """The header of the newest checkpoint of a run from scratch."""
    paths = (folder / CHECKPOINTS / name for name in NAMES)
    found, _ = read_newest(paths, make_run(composed(*LINE, *SCRATCH)).config_hash)
    assert found is not None
    return found[1]


class PowerCutError(Exception):
    """Simulates a kill: the package does not handle it."""


def cut() -> None:
    raise PowerCutError


def train_and_kill(after: Callable[[int, Callable[[], Any]], None], folder: str, *overrides: str) -> None:
    after(9, cut)
    with pytest.raises(PowerCutError):
        train(folder, *overrides)


ARMS = {
    "states": ("target=4", "method=scratch"),
    "features": ("+pair=high", "+arm=FE3", *SMALL),
    "perturbed suite": (
        *("target=paper", "method=scratch", *SMALL, "learn.num_envs=3", "perturbation.own_position=40"),
        "learn.evaluate_episodes=4",
    ),
    "a rollout": (
        *(*SCRATCH, "algorithm=ppo", "learn.num_envs=2", "algorithm.rollout_steps=40"),
        *("algorithm.minibatch_size=32", "algorithm.imitation_coeff=1"),
    ),
    "a mask": (*SCRATCH, "mask=rules", "learn.jumpstart_draws=2"),
    "a pupil": (*SCRATCH, "algorithm=pupil", "algorithm.teacher=pretrained:4"),
    "features of three ships": ("+pair=high", "+arm=FE3", *SMALL, "learn.num_envs=3"),
    "a guide": ("+pair=high", "+arm=G3", *SMALL, "transfer.guide.period=1"),
    "a fading policy": ("+pair=high", "+arm=QD3", *SMALL),
    "a sum": ("+pair=high", "+arm=QR", "observation=vector", "algorithm=n_step"),
    "thawing layers": ("+pair=high", "+arm=GU3", *SMALL),
    "vectors": ("+pair=high", "+arm=FE2", "observation=vector", "learn.num_envs=3"),
}


# The others take longest and cover the least.
QUICK = ("states", "a rollout", "a mask")


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """Return the files of an uninterrupted run from scratch."""
    return left(train(str(tmp_path_factory.mktemp("whole")), *SCRATCH))


@pytest.mark.parametrize(
    "arm", [pytest.param(arm, marks=[pytest.mark.long] * (arm not in QUICK)) for arm in ARMS]
)
def test_stopped_and_killed_it_ends_with_the_same_bytes(
    arm: str, after: Callable[[int, Callable[[], Any]], None], monkeypatch: pytest.MonkeyPatch
) -> None:
    line = ARMS[arm]
    if arm == "states":  # once with real pictures
        for name, drawn in OF_RUNS.items():
            monkeypatch.setattr(experiment, name, drawn)
    if "+pair=high" in line:
        # Trained once, for both.
        train("one", "target=1", "method=scratch", *line[2:])
        shutil.copytree("one", "other")
    whole = left(train("one", *line))
    after(3, lambda: signal.raise_signal(signal.SIGTERM))
    with pytest.raises(
        StoppedError, match=r"stopped at episode (\d) of 9; run .* again to resume from episode \1"
    ):
        train("other", *line)
    after(4, cut)
    with pytest.raises(PowerCutError):
        train("other", *line)
    after(10**9, cut)
    assert left(train("other", *line)) == whole


def test_it_resumes_from_the_checkpoint_before_a_damaged_one(
    whole: dict[str, Any],
    after: Callable[[int, Callable[[], Any]], None],
    capsys: pytest.CaptureFixture[str],
) -> None:
    train_and_kill(after, "other", *SCRATCH)
    after(10**9, cut)
    folder = Path("other/4/scratch/seed=0")
    newest = newest_checkpoint(folder)
    for path in (folder / CHECKPOINTS).glob("*.safetensors"):
        data = bytearray(path.read_bytes())
        if f'\\"steps\\": {newest.steps}'.encode() in data:
            data[-1000] ^= 1
            path.write_bytes(data)
    capsys.readouterr()
    assert left(train("other", *SCRATCH)) == whole
    said = capsys.readouterr().out
    assert "is damaged; the other checkpoint is used" in said
    assert f"resuming from the checkpoint at episode {newest.episode - 1} of 9" in said
    # The last evaluation before the checkpoint is known.
    assert re.search(rf"episode {newest.episode} of 9, return \S+, greedy -?\d", said)


def test_an_unfinished_run_of_other_settings_is_not_lost(
    after: Callable[[int, Callable[[], Any]], None],
) -> None:
    train_and_kill(after, "out", *SCRATCH)
    before = files(Path("out/4"))
    words = r"run of other settings \(learn.lr=0.0001\); allowed: another output"
    with pytest.raises(TakenError, match=words):
        train("out", *SCRATCH, "learn.lr=1e-3")
    assert files(Path("out/4")) == before
    for path in Path("out/4/scratch/seed=0", CHECKPOINTS).glob("*.safetensors"):
        path.write_bytes(path.read_bytes()[:1000])
    before = files(Path("out/4"))
    with pytest.raises(TakenError, match=r"\(learn.lr=0.0001\)"):
        train("out", *SCRATCH, "learn.lr=1e-3")
    assert files(Path("out/4")) == before
    after(10**9, cut)
    train("out", *SCRATCH, "learn.lr=1e-3", "overwrite=true")
    assert len(read_curve(Path("out/4/scratch/seed=0"))) == 9 + 4


def test_other_arithmetic_is_refused_and_a_grid_starts_over(
    after: Callable[[int, Callable[[], Any]], None], capsys: pytest.CaptureFixture[str]
) -> None:
    train_and_kill(after, "out", *SCRATCH, "learn.precision=fp32")
    before = files(Path("out/4"))
    dense = (*SCRATCH, "learn.precision=fp32", "learn.backend=dense")
    with pytest.raises(
        ConfigError, match=r"computed by float32 incremental .* dense .* or overwrite=true to st"
    ):
        train("out", *dense)
    assert files(Path("out/4")) == before
    after(10**9, cut)
    whole = left(train("one", *dense))
    shutil.copytree("out", "again")
    assert left(train("again", *dense, "overwrite=true")) == whole
    assert "the run starts over" in capsys.readouterr().out
    run = make_run(composed(*LINE, "output=out", *dense))
    run_experiment(run, "1 of 2")
    assert left(run.folder) == whole
    assert "the run starts over" in capsys.readouterr().out


def test_a_loss_that_is_not_finite_ends_it_and_keeps_the_last_good_checkpoint(
    whole: dict[str, Any], after: Callable[[int, Callable[[], Any]], None], monkeypatch: pytest.MonkeyPatch
) -> None:
    made: list[Parts] = []
    make = experiment.make_parts

    def make_parts(*given: Any) -> Parts:
        made.append(make(*given))
        return made[-1]

    monkeypatch.setattr(experiment, "make_parts", make_parts)

    def spoil() -> None:
        with torch.no_grad():
            cast(DoubleDQN, made[0].algorithm).online_network.shared.weight.fill_(float("inf"))

    after(9, spoil)
    with pytest.raises(ConfigError, match=r"finite after environment step \d+.* episode 5 is kept"):
        train("out", *SCRATCH)
    assert newest_checkpoint(Path("out/4/scratch/seed=0")).episode == 5
    after(10**9, cut)
    # It resumes from there, where the weights were finite.
    assert left(train("out", *SCRATCH)) == whole


def test_a_full_disk_costs_the_checkpoint_and_not_the_training(
    whole: dict[str, Any], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def full(*_: Any) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(checkpoint, "write", full)
    assert left(train("other", *SCRATCH)) == {k: v for k, v in whole.items() if k != LAST_CHECKPOINT}
    assert "no checkpoint at episode 1: No space left on device" in capsys.readouterr().out
