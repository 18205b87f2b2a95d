"""If wandb fails, the training continues; a resumed run is one run in wandb."""

import sys
import types
from pathlib import Path
from typing import Any

import pytest

from ship_trl.config.errors import ConfigError
from ship_trl.config.types import trackers_of
from ship_trl.run.history import to_row
from ship_trl.run.plan import CHECKPOINTS, make_run
from ship_trl.run.trackers import Trackers
from ship_trl.run.trackers.wandb import WandbTracker, start
from tests.config.test_config import composed
from tests.run.test_history import FINISHED

LINE = ("target=1", "method=scratch", "logger=wandb", "output=out")


class Error(Exception):
    """Simulates wandb's own errors."""


class Server:
    """Simulates wandb: records what was begun and logged, and fails where it is told to."""

    def __init__(self, root: Path) -> None:
        self.root = root
        self.begun: list[dict[str, Any]] = []
        self.logged: list[dict[str, Any]] = []
        self.known: dict[str, int] = {}
        self.fails: dict[str, Exception] = {}

    def init(self, **given: Any) -> Any:
        self.begun.append(given)
        if (error := self.fails.get(given["mode"])) is not None:
            raise error
        folder = self.root / f"wandb/{given['mode']}-run-{len(self.begun)}-{given['id']}"
        (folder / "files").mkdir(parents=True)
        resumed = self.known.get(given["id"], 0) if given["resume"] else 0
        return types.SimpleNamespace(
            dir=str(folder / "files"),
            url=None,
            starting_step=resumed,
            define_metric=lambda *_, **__: None,
            log=self.log,
            finish=self.finish,
        )

    def log(self, values: dict[str, Any]) -> None:
        if (error := self.fails.get("log")) is not None:
            raise error
        self.logged.append(values)

    def finish(self, exit_code: int) -> None:
        if (error := self.fails.get("finish")) is not None:
            raise error


@pytest.fixture
def server(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Server:
    found = Server(tmp_path / "out")
    module = types.ModuleType("wandb")
    module.__dict__.update(init=found.init, Error=Error, Settings=lambda **given: given)
    monkeypatch.setitem(sys.modules, "wandb", module)
    return found


def tracker(*overrides: str) -> WandbTracker:
    run = make_run(composed(*LINE, *overrides))
    (run.folder / CHECKPOINTS).mkdir(parents=True, exist_ok=True)
    found = WandbTracker(run)
    found.begin()
    return found


def test_without_a_network_or_with_a_wrong_key_it_logs_offline(
    server: Server, capsys: pytest.CaptureFixture[str]
) -> None:
    server.fails["online"] = Error("the network\nis gone")
    tracker("wandb.mode=online").log(to_row(FINISHED))
    assert [given["mode"] for given in server.begun] == ["online", "offline"] and len(server.logged) == 1
    assert capsys.readouterr().out == "wandb: the network is gone; this run is logged offline\n"


def test_runs_are_found_by_task_arm_method_layers_and_algorithm(server: Server) -> None:
    run = make_run(composed("+pair=high", "+arm=FT3", "logger=wandb", "output=out"))
    start(run)
    (given,) = server.begun
    assert (given["group"], given["job_type"]) == ("high", "FT3")
    assert given["tags"] == ["high", "FT3", "double_dqn", "finetune", "quick", "layers=3"]
    config = given["config"]
    assert (config["task"], config["arm"], config["algo"], config["seed"]) == ("high", "FT3", "double_dqn", 0)


def test_a_wandb_refusal_comes_before_training(server: Server) -> None:
    server.fails["offline"] = Error("no such project")
    with pytest.raises(ConfigError, match=r"wandb: no such project; logger=csv trains without wandb"):
        start(make_run(composed(*LINE)))
    Path("a_file").touch()
    with pytest.raises(ConfigError, match=r"wandb: .*a_file.*; logger=csv trains without wandb"):
        start(make_run(composed(*LINE, "wandb.folder=a_file")))


@pytest.mark.parametrize("call", ["log", "finish"])
def test_a_later_failure_is_reported_once_and_ends_nothing(
    call: str, server: Server, capsys: pytest.CaptureFixture[str]
) -> None:
    found = tracker()
    server.fails[call] = OSError(28, "No space left on device")
    found.log(to_row(FINISHED))
    found.log(to_row(FINISHED))
    found.close(failed=False)
    said = capsys.readouterr().out
    assert said.count("the run continues without wandb") == 1


def test_offline_a_resumed_run_replaces_its_first_part(server: Server) -> None:
    tracker().log(to_row(FINISHED))
    (first,) = server.root.glob("wandb/*")
    tracker()
    (second,) = server.root.glob("wandb/*")
    assert first != second and server.begun[0]["id"] == server.begun[1]["id"]


def test_online_a_resumed_run_keeps_its_id_and_logs_nothing_twice(server: Server) -> None:
    found = tracker("wandb.mode=online")
    for _ in range(3):
        found.log(to_row(FINISHED))
    server.known[server.begun[0]["id"]] = 3
    again = tracker("wandb.mode=online")
    for _ in range(5):  # the server has three of them
        again.log(to_row(FINISHED))
    assert server.begun[1]["id"] == server.begun[0]["id"] and server.begun[1]["resume"] == "allow"
    assert len(server.logged) == 5


@pytest.mark.parametrize(("mode", "begun"), [("disabled", 0), ("online", 1), (None, 1)])
def test_of_wandbs_own_variable_only_disabled_counts(
    mode: str | None, begun: int, server: Server, monkeypatch: pytest.MonkeyPatch
) -> None:
    if mode is None:
        monkeypatch.delenv("WANDB_MODE", raising=False)
    else:
        monkeypatch.setenv("WANDB_MODE", mode)
    for logger in ("csv", "wandb"):
        with Trackers(make_run(composed(*LINE, f"logger={logger}", f"output={logger}"))) as tracked:
            tracked.log(to_row(FINISHED))
    assert [one["mode"] for one in server.begun] == ["offline"] * begun
    assert trackers_of("all") == ["csv", "tensorboard", *["wandb"] * begun]
