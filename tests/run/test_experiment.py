"""One source network is trained once, whoever asks for it, and as whatever."""

import threading
from pathlib import Path
from typing import Any

import pytest

from ship_trl.result import Result
from ship_trl.run import experiment
from ship_trl.run.experiment import find_source
from ship_trl.run.plan import Run, make_run
from tests.a_result import a_result
from tests.test_config import composed


@pytest.fixture
def trained(monkeypatch: pytest.MonkeyPatch) -> list[Path]:
    """Folders of runs that were trained, in no time."""
    folders: list[Path] = []

    def train_run(run: Run, *_: Any) -> Result:
        folders.append(run.folder)
        run.folder.mkdir(parents=True)
        for name in ("policy.safetensors", "config.yaml"):
            (run.folder / name).write_text("")
        return a_result()

    monkeypatch.setattr(experiment, "train_run", train_run)
    return folders


def test_a_source_that_is_a_run_of_its_own_is_waited_for(tmp_path: Path, trained: list[Path]) -> None:
    run = make_run(composed("+pair=high", "layers=3", "profile=smoke", f"output={tmp_path}"))
    assert run.source is not None
    asking = threading.Thread(target=find_source, args=(run, "1 of 1"))
    with run.source.lock():  # as `target=1 method=scratch` holds it while it trains
        asking.start()
        asking.join(0.5)
        assert asking.is_alive() and trained == []
    asking.join(10)
    assert trained == [run.source.folder]
    entry = find_source(run, "1 of 1")
    assert entry is not None and entry.policy.is_file() and len(trained) == 1
