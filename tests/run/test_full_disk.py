"""A full disk: every writer of a run's files names the file, and the command says so in one line."""

import resource
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from ship_trl.cli.errors import hydra_errors
from ship_trl.files.result import write_result
from ship_trl.learn.train import Finished
from ship_trl.run.plan import make_run
from ship_trl.run.rows import row
from ship_trl.run.tracking import CsvTracker
from ship_trl.sim.cases import load_case, load_world
from ship_trl.sim.render import Rasteriser
from ship_trl.transfer.casebase import CaseBase
from ship_trl.transfer.layers import save_weights
from ship_trl.view.curves import draw_curve
from ship_trl.view.film import write_gif
from tests.a_result import a_result
from tests.command import ship_trl
from tests.config.test_config import composed
from tests.learn.networks import network
from tests.run.test_tracking import FINISHED
from tests.view.episodes import run_actions


@contextmanager
def largest_file(size: int) -> Iterator[None]:
    """Let no file grow past so many bytes, as if the disk were full then."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


def write_curve(folder: Path) -> None:
    tracker = CsvTracker(folder)
    try:
        tracker.log(row(FINISHED))
    finally:
        tracker.close()


def picture(folder: Path) -> None:
    finished = [Finished(1, 30, 0.5, 1.0, 30, "goal", 60.0, None)]
    draw_curve(folder / "curve.png", finished, [(0, 1.0, "goal"), (1, 2.0, "goal")], 3.0, "made")


def film(folder: Path) -> None:
    world = load_world()
    case = load_case("1", world)
    episode = run_actions(case, world, [3, 3, 3])
    write_gif(folder / "episode.gif", case, world, episode, Rasteriser(case, world))


def retain(folder: Path) -> None:
    for name in ("policy.safetensors", "config.yaml"):
        (folder / name).touch()
    base = CaseBase(folder / "case_base")
    base.retain(load_case("1", load_world()), "scratch", 0, "hash", {"best": 1.0}, folder)


WRITERS: dict[str, Callable[[Path], None]] = {
    "curve.csv": write_curve,
    "curve.png": picture,
    "episode.gif": film,
    "policy.safetensors": lambda folder: save_weights(folder / "policy.safetensors", network(), {}),
    "result.json": lambda folder: write_result(folder, a_result()),
    "entry.json": retain,
}


@pytest.mark.parametrize("name", WRITERS)
def test_what_cannot_be_written_is_named(name: str, tmp_path: Path) -> None:

    WRITERS[name](tmp_path)  # compiles and loads what else would be written now
    for path in tmp_path.rglob("*.json"):
        path.unlink()
    with pytest.raises(OSError, match="File too large") as raised, largest_file(10):
        WRITERS[name](tmp_path)
    assert Path(raised.value.filename).name == name
    assert not list(tmp_path.rglob(f".{Path(name).stem}*"))  # no draft is left


def test_a_folder_that_cannot_be_written_is_named(tmp_path: Path) -> None:
    from ship_trl.config.errors import ConfigError
    from ship_trl.run.folder import open_folder

    run = make_run(composed("target=1", "method=scratch", f"output={tmp_path}"))
    with (
        pytest.raises(ConfigError, match=r"config\.yaml cannot be written: File too"),
        largest_file(10),
    ):
        open_folder(run)


@pytest.mark.parametrize(
    ("error", "line"),
    [
        (OSError(28, "No space left on device", "curve.csv"), "curve.csv: No space left on device"),
        (OSError(28, "No space left on device"), "a file: No space left on device"),
        (
            OSError(28, "No space left", "a.safetensors", None, "b.safetensors"),
            "b.safetensors: No space left",
        ),
    ],
)
def test_an_error_of_the_file_system_is_one_line(
    error: OSError, line: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("HYDRA_FULL_ERROR", "0")
    with pytest.raises(SystemExit) as ended, hydra_errors():
        raise error
    assert ended.value.code == 1
    assert capsys.readouterr().err == f"ship_trl: {line}\n"


def test_a_run_on_a_full_disk_ends_with_one_line(tmp_path: Path) -> None:
    # Weights are larger, and what else is written, compiled loops too, is smaller.
    first = "import resource; resource.setrlimit(resource.RLIMIT_FSIZE, (1_000_000,) * 2)"
    line = ("profile=smoke", "learn.warmup_steps=1000000", "target=1", "method=scratch")
    done = ship_trl(*line, folder=tmp_path, code=1, first=first)
    place = Path("outputs/smoke/1/scratch/seed=0/policy.safetensors")
    assert done.stderr == f"ship_trl: {place}: File too large\n"
    assert not (tmp_path / place.parent / "result.json").exists()
