"""Demonstrations: written, read again, put into a replay, refused where they are wrong."""

import json
from pathlib import Path

import pytest

from ship_trl.config.errors import ConfigError
from ship_trl.policies.demonstrations import Demonstration, read_demonstrations, write_demonstration
from ship_trl.policies.reference import best_known
from ship_trl.sim.cases import load_case, load_world
from tests.command import ship_trl

WORLD = load_world()
CASE = load_case("4", WORLD)
LINE = (
    *("target=4", "method=scratch", "profile=smoke", "learn.episodes=4", "learn.warmup_steps=40"),
    "learn.jumpstart_draws=0",
)


def kept(folder: Path, episode_return: float | None = None) -> Path:
    """Keep the planner's plan of case 4, with its own return or another one."""
    plan = best_known(CASE, WORLD)
    ended = plan.episode_return if episode_return is None else episode_return, "goal"
    return write_demonstration(folder, CASE, WORLD, plan.actions, ended, "planner")


def test_what_is_written_is_read(tmp_path: Path) -> None:
    first, second = kept(tmp_path / "demos"), kept(tmp_path / "demos")
    assert (first.name, second.name) == ("4-001.json", "4-002.json")
    one, other = read_demonstrations(tmp_path / "demos", CASE, WORLD)
    assert one == other and isinstance(one, Demonstration)
    plan = best_known(CASE, WORLD)
    assert (one.actions, one.episode_return, one.by) == (plan.actions, plan.episode_return, "planner")


def test_an_interrupted_one_leaves_no_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupt(_: Path) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("ship_trl.policies.demonstrations.atomic_write", interrupt)
    with pytest.raises(KeyboardInterrupt):
        kept(tmp_path)
    assert list(tmp_path.iterdir()) == []


def test_demonstrations_of_other_cases_are_skipped(tmp_path: Path) -> None:
    kept(tmp_path)
    with pytest.raises(ConfigError, match="demonstrations: none of case 2 in"):
        read_demonstrations(tmp_path, load_case("2", WORLD), WORLD)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"actions": [7]}, ": actions: each must be from 0 to 6, got 7"),
        ({"actions": []}, r": actions: must be at least one action, got \[\]"),
        ({"episode_return": float("nan")}, ": episode_return: must be a finite number, got NaN"),
        ({"schema_version": 2}, ": schema_version: must be 1, got 2"),
        ({"world": "x"}, " was recorded in another world"),
        (None, ": cannot be read as JSON"),
    ],
)
def test_a_file_that_is_not_right_is_refused(
    tmp_path: Path, change: dict[str, object] | None, message: str
) -> None:
    path = kept(tmp_path)
    path.write_text("" if change is None else json.dumps(json.loads(path.read_text()) | change))
    with pytest.raises(ConfigError, match=f"demonstrations: .*4-001.json{message}"):
        read_demonstrations(tmp_path, CASE, WORLD)


def test_a_training_begins_with_them(tmp_path: Path) -> None:
    """The command that keeps them, and a run whose first update may see them."""
    ship_trl("best_known", "target=4", "--demonstrations", "demos", folder=tmp_path, verb="evaluate")
    done = ship_trl(*LINE, "demonstrations=demos", "output=runs", folder=tmp_path)
    assert "case 4, scratch-demonstrations" in done.stdout
    ship_trl(*LINE, "output=runs", folder=tmp_path)
    arms = [tmp_path / "runs" / "4" / arm / "seed=0" for arm in ("scratch-demonstrations", "scratch")]
    hashes = {json.loads((arm / "result.json").read_text())["config_hash"] for arm in arms}
    assert len(hashes) == 2
    # The same exploration, and other updates.
    curves = [(arm / "curve.csv").read_text().splitlines() for arm in arms]
    assert curves[0][1] == curves[1][1] and curves[0][-1] != curves[1][-1]
