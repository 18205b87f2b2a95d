"""Rows of many episodes: scenes by name, and the numbers of the rules."""

from dataclasses import replace

import pytest

from ship_trl.cli.evaluate import GOOD_SCORES, MILES_OF_ALL, RULE_SCORES, SCORES, Scored
from ship_trl.config.types import World
from ship_trl.policies.named import rollout_entry
from ship_trl.policies.pretrained import suites
from ship_trl.policies.registry import Entry, split_suites
from ship_trl.policies.rule_table import HEADINGS, describe_rules, rule_rows
from ship_trl.sim.cases import load_suite
from ship_trl.sim.scale import Scale
from ship_trl.sim.state import first_case
from tests.command import ROOT

SEA = Scale(12.35, 0.41, "2025-06-01 08:30:00+00:00")


def evaluated(world: World, suite: str, episodes: int | None = None) -> Scored:
    entry = Entry("keep_course", "keep_course", load_suite(suite, world), world, colour=False)
    return Scored(entry, rollout_entry(entry, episodes)[2], 5.0)


def test_scenes_have_the_names_of_their_cases(world: World) -> None:
    fixed, drawn = evaluated(world, "paper"), evaluated(world, "paper_perturbed", 14)
    assert [fixed.scene_name(row) for row in (0, 6)] == ["1", "new"]
    assert [drawn.scene_name(row) for row in (0, 6, 7, 13)] == ["1 (1)", "new (1)", "1 (2)", "new (2)"]
    # A scene can be watched by its seed.
    traffic = evaluated(world, "traffic", 3)
    for entry, episode in zip(split_suites([traffic.entry]), traffic.episodes, strict=False):
        case = first_case(traffic.entry.suite, episode.states[0])
        assert entry.suite.case == replace(case, name=entry.suite.name)
    assert [traffic.scene_name(row) for row in range(3)] == [f"seed {seed}" for seed in range(3)]


def test_good_scores_are_those_of_the_page() -> None:
    table = (ROOT / "docs/encounters.md").read_text().partition("### imazu")[2].partition("###")[0]
    rows = [line.strip("| ").split(" | ") for line in table.splitlines() if line.startswith("| ")]
    of = {row[0]: dict(zip(rows[0], row, strict=True)) for row in rows[2:]}

    def best(*policies: str) -> str:
        *others, last = (max(of[policy][rule] for policy in policies) for rule in RULE_SCORES)
        return f"{min(others)} to {max(others)} (R17: {last})"

    planners, networks = (
        best("vo", "sb_mpc", "apf", "manoeuvre_rules"),
        best(*(f"pretrained:{one.name}" for one in suites())),
    )
    assert f"in imazu planners have up to {planners}, networks up to {networks}" == GOOD_SCORES


def test_the_table_of_the_rules_is_the_one_of_the_page(world: World) -> None:
    """Of `keep_course`, which takes seconds; the other rows take minutes."""
    page = (ROOT / "docs/encounters.md").read_text()
    lines = page.partition("<!-- begin: rules -->")[2].partition("<!-- end -->")[0].splitlines()
    table = [[cell.strip() for cell in line[1:-2].split("|")] for line in lines if line.startswith("| ")]
    command = next(line for line in lines if line.startswith("`python -m ship_trl evaluate "))
    words = command.strip("`").split()[4:]
    assert words[-3:] == ["target=traffic_test", "--rules", "--markdown"]
    assert list(dict.fromkeys(row[0] for row in table[2:])) == words[:-3]
    assert table[0] == list(HEADINGS[1:]) and describe_rules(world.safe_distance) in lines
    own = evaluated(world, "traffic_test")
    rows = [["keep_course", *cells] for cells in rule_rows(own.measured, world.safe_distance)]
    assert [row for row in table if row[0] == "keep_course"] == rows


def test_every_row_has_the_cells_of_the_headings(world: World) -> None:
    one = evaluated(world, "traffic", 20)
    rows = [one.row(None), *one.class_rows()]
    assert {len(row) for row in rows} == {len(SCORES)}
    assert rows[0][2] == "20" and sum(int(row[2]) for row in rows[1:]) == 20


def test_scenes_of_other_tools_have_miles_and_times(world: World) -> None:
    own = evaluated(world, "paper")
    cases = tuple(replace(case, scale=SEA) for case in own.entry.suite.cases)
    found = replace(own, entry=replace(own.entry, suite=replace(own.entry.suite, cases=cases)))
    place = SCORES.index(MILES_OF_ALL)
    assert own.row(None)[place] == "" and len(found.row(None)) == len(SCORES)
    cells = (found.row(None)[k].replace("(", "").strip(")").split() for k in (place - 1, place))
    metres, miles = ([float(word) for word in words] for words in cells)
    assert miles == pytest.approx([length * 12.35 / 1852 for length in metres], abs=0.01)
    (plain, *_), (row, *others) = list(own.csv_rows()), list(found.csv_rows())
    assert {*row} - {*plain} == {"start_utc", "least_distance_nm"} and row["least_distance_nm"] == ""
    assert {one["start_utc"] for one in others} == {SEA.start}
    length, nautical = (float(others[0][f"least_distance{end}"]) for end in ("", "_nm"))
    assert nautical == pytest.approx(length * 12.35 / 1852, rel=1e-4)
