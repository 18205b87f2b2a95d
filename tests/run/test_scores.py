"""Rows of many episodes: scenes by name, and the numbers of the rules."""

from dataclasses import replace

from ship_trl.config.types import World
from ship_trl.policies.entry import Entry, example_scenes, rollout_entry
from ship_trl.run.scores import HEADINGS, Scored
from ship_trl.sim.state import first_case
from ship_trl.sim.suites import load_suite


def evaluated(world: World, suite: str, episodes: int | None = None) -> Scored:
    entry = Entry("keep_course", "keep_course", load_suite(suite, world), world, colour=False)
    return Scored(entry, rollout_entry(entry, episodes)[2], 5.0)


def test_scenes_have_the_names_of_their_cases(world: World) -> None:
    fixed, drawn = evaluated(world, "paper"), evaluated(world, "paper_perturbed", 14)
    assert [fixed.scene_name(row) for row in (0, 6)] == ["1", "new"]
    assert [drawn.scene_name(row) for row in (0, 6, 7, 13)] == ["1 (1)", "new (1)", "1 (2)", "new (2)"]
    # A scene can be watched by its seed.
    traffic = evaluated(world, "traffic", 3)
    scenes = example_scenes(traffic.entry.suite, world, 0)
    for scene, episode in zip(scenes, traffic.episodes, strict=False):
        assert scene.case == replace(first_case(traffic.entry.suite, episode.states[0]), name=scene.name)
    assert [traffic.scene_name(row) for row in range(3)] == [f"seed {seed}" for seed in range(3)]


def test_every_row_has_the_cells_of_the_headings(world: World) -> None:
    one = evaluated(world, "traffic", 20)
    rows = [one.row(None), *one.class_rows()]
    assert {len(row) for row in rows} == {len(HEADINGS)}
    assert rows[0][2] == "20" and sum(int(row[2]) for row in rows[1:]) == 20
