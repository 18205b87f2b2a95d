"""Fixtures of all tests: an empty working directory, the paper's world, cases, a study."""

import gc
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from hypothesis import find, settings
from hypothesis import strategies as st

from ship_trl.config.types import World
from ship_trl.sim.cases import Case, TargetShip, load_world
from tests.command import KEYS
from tests.study.commands import SMALL, study

# The same examples every time, and no deadline, because the machine may be busy.
settings.register_profile("steady", deadline=None, derandomize=True, max_examples=50)
settings.load_profile("steady")


# The first compiles all loops; those after it need none until another worker finds them in the cache.
# The others take longest, or a worker would wait for another one at the end.
FIRST = (
    *("cli/test_errors.py", "studies/paper/test_claims.py", "study/report/test_write.py", "test_findings.py"),
    *("study/test_study.py", "run/test_training.py", "test_faults.py", "explain/test_explain.py"),
    *("test_examples.py", "run/test_setup.py", "run/test_beside_the_csv.py", "benchmarks/test_peers.py"),
)


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Bring some files to the front, in their order."""
    paths = [Path(__file__).parent / name for name in FIRST]
    items.sort(key=lambda item: paths.index(item.path) if item.path in paths else len(paths))


def pytest_collection_finish() -> None:
    """Leave what has been imported out of every later search for garbage; each run makes one."""
    # Hypothesis looks for what holds its generator, and would not find what is left out: it makes it now.
    find(st.none(), lambda _: True)
    gc.collect()
    gc.freeze()


@pytest.fixture(scope="session", autouse=True)
def light_runs() -> None:
    """Use one torch thread, and let runs of this process write dots in place of pictures."""
    # Not above: the process that hands tests to workers would import it first, while they wait.
    import torch

    from ship_trl.run import experiment
    from tests.pictures import OF_RUNS, draw_a_dot

    torch.set_num_threads(1)
    vars(experiment).update(dict.fromkeys(OF_RUNS, draw_a_dot))


@pytest.fixture(autouse=True)
def denormal_numbers() -> Iterator[None]:
    """Restore denormal numbers after a test: a run in this process flushes them to zero."""
    yield
    import torch

    torch.set_flush_denormal(False)


@pytest.fixture(autouse=True)
def empty_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Work in the test's own folder, without the results and cases of the folder it was started in."""
    monkeypatch.chdir(tmp_path)


@pytest.fixture
def world() -> World:
    return load_world()


@pytest.fixture
def finished_run(tmp_path: Path) -> Path:
    """A folder with the files that a case base stores."""
    folder = tmp_path / "run"
    folder.mkdir()
    (folder / "policy.safetensors").write_bytes(b"weights")
    (folder / "config.yaml").write_text("seed: 0\n")
    return folder


@pytest.fixture(scope="session")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A study that ran through, for tests that compare with it."""
    folder = tmp_path_factory.mktemp("whole")
    with pytest.MonkeyPatch.context() as patch:
        for name, key in KEYS.items():
            patch.setenv(name, key)
        # In the command's own process; others would import torch again.
        done = study(*SMALL, "processes=1", folder=folder)
    assert "6 of 6 runs to do, " in done.stdout
    return folder


@pytest.fixture
def make_case() -> Callable[..., Case]:
    """Build a case from target ships given as (x, y, heading in degrees, speed)."""

    def make(*ships: tuple[float, float, float, float], **changes: Any) -> Case:
        values: dict[str, Any] = {
            "start": [0.0, 0.0],
            "heading": 90.0,
            "goal": [0.0, 600.0],
            "ideal_path": "any",
        }
        return Case(**(values | changes), target_ships=[TargetShip(*ship) for ship in ships], name="made")

    return make
