"""Tables of fixed scenes, and the scenes of `traffic_test`."""

from collections import Counter
from pathlib import Path

import pytest

from ship_trl.config.errors import ConfigError
from ship_trl.config.paths import conf_dir
from ship_trl.config.types import World
from ship_trl.policies.reference import follow_plan
from ship_trl.sim.cases import TABLE_COLUMNS, load_suite, read_scenes
from studies.scenes import EMPTY_ROOM, ROOM, draw_case, write_scenes

TABLE = conf_dir() / "suite" / "traffic_test.csv"


def test_a_table_is_read_as_it_was_written(tmp_path: Path) -> None:
    scenes = read_scenes(TABLE)[:40]
    write_scenes(tmp_path / "some.csv", scenes)
    assert read_scenes(tmp_path / "some.csv") == scenes


def test_the_scenes_are_balanced_and_those_of_their_seeds(world: World) -> None:
    suite = load_suite("traffic_test", world)
    strata = Counter((len(case.target_ships), case.ideal_path) for case in suite.cases)
    assert set(strata.values()) == {ROOM, EMPTY_ROOM} and len(strata) == 16 and len(suite.cases) == 500
    assert len({case.fingerprint for case in suite.cases}) == 500 - EMPTY_ROOM + 1
    for case in suite.cases[::25]:
        _, drawn = draw_case(int(case.name.removeprefix("traffic_")), world)
        assert drawn == case


def test_each_plan_reaches_the_goal_with_its_return(world: World) -> None:
    for scene in read_scenes(TABLE)[::10]:
        plan = follow_plan(scene.case, world, scene.actions)
        assert plan.goal and plan.episode_return == pytest.approx(scene.best_return, abs=1e-3)


def row(x: str, speed: str = "15") -> str:
    """Return a table of one scene with one ship."""
    return f"{','.join(TABLE_COLUMNS)}\none,none,{x},0,180,{speed},,,,,,,,,1,33\n"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("name,encounter\n", "is not a table of scenes: it has no column 'x1'"),
        (row("nan"), "row one: ship 1: x: must be a finite number, got"),
        (row("500", speed=""), "row one: ship 1: speed: must be a valid number, got"),
        (None, "cannot be read: No such file"),
    ],
)
def test_a_wrong_table_is_refused(text: str | None, message: str, tmp_path: Path) -> None:
    path = tmp_path / "wrong.csv"
    if text is not None:
        path.write_text(text)
    with pytest.raises(ConfigError, match=message):
        read_scenes(path)
