"""A study in wandb: its runs lie together, grouped, and one of them is the report."""

import contextlib
import dataclasses
import json
import subprocess
import sys
import types
from pathlib import Path
from typing import Any

import pytest

from ship_trl.study.launch import command, log_summary
from ship_trl.study.plan import plan_jobs, to_study
from tests.command import environment
from tests.study.commands import SMALL, study


def records(run: Path) -> list[dict[str, Any]]:
    """What an offline run holds, read without network by wandb's own tool."""
    done = subprocess.run(
        [sys.executable, "-m", "wandb", "leet", "inspect", "--json", str(run)],
        env=environment(),
        capture_output=True,
        text=True,
        check=True,
    )
    return [json.loads(line) for line in done.stdout.splitlines()]


@pytest.mark.long
def test_a_study_is_one_project_with_a_summary_run(tmp_path: Path) -> None:
    study(*SMALL, "arms=[FTW]", "logger=wandb", "wandb.project=mine", folder=tmp_path, pictures=True)
    place = tmp_path / "outputs/smoke_study"
    runs = {}
    for path in (place / "wandb").glob("offline-run-*"):
        found = records(path)
        (run,) = (record["run"] for record in found if record["type"] == "run")
        assert run["project"] == "mine"
        assert run["run_group"] == "smoke_study"
        runs[run["job_type"], run["display_name"]] = found
    assert runs.keys() == {
        ("report", "report of smoke_study"),
        *(("scratch", f"1/scratch/seed={seed}") for seed in (0, 1)),
        *(("FTW", f"high/FTW/seed={seed}") for seed in (0, 1)),
    }
    report = json.dumps(runs["report", "report of smoke_study"])
    assert all(name in report for name in ("pair_high", "arms", "table_2", "page"))
    assert list((place / "wandb").rglob("pair_high*.png")) and list((place / "wandb").rglob("page*.html"))


def test_a_table_does_not_replace_the_figure_of_its_name(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    logged: dict[str, Any] = {}
    run = types.SimpleNamespace(log=logged.update, summary={})
    fake = types.SimpleNamespace(
        Error=RuntimeError,
        Image=Path,
        Html=lambda path, inject: path,
        Table=lambda dataframe: list(dataframe.columns),
        init=lambda **_: contextlib.nullcontext(run),
    )
    monkeypatch.setitem(sys.modules, "wandb", fake)
    (tmp_path / "report").mkdir()
    (tmp_path / "report/effects.png").touch()
    (tmp_path / "report/effects.csv").write_text("arm,difference\nFT3,1\n")
    log_summary(to_study(["logger=wandb", f"output={tmp_path}"]))
    assert logged["effects"] == tmp_path / "report/effects.png"
    assert logged["table/effects"] == ["arm", "difference"]


def test_the_runs_get_the_studys_project() -> None:
    config = to_study(["logger=wandb", "wandb.mode=online", "wandb.entity=us"])
    line = command(plan_jobs(config)[:1], config)
    wanted = {"logger=wandb", "wandb.project=ship_trl_study", "wandb.mode=online", "wandb.entity=us"}
    assert wanted < set(line)
    assert {*wanted, "logger=all"} - {"logger=wandb"} < set(
        command(plan_jobs(config)[:1], dataclasses.replace(config, logger="all"))
    )
    assert not any("wandb" in word for word in command(plan_jobs(to_study([]))[:1], to_study([])))


def test_online_without_an_account_is_said_at_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("HOME", str(tmp_path / "home"))
    monkeypatch.delenv("WANDB_API_KEY", raising=False)
    done = study("profile=smoke", "logger=wandb", "wandb.mode=online", folder=tmp_path, code=1)
    assert done.stderr.strip() == (
        "ship_trl: wandb: not logged in; run `wandb login`; allowed: wandb.mode=offline"
    )
    assert list(tmp_path.iterdir()) == []
