"""The confirmatory study's kept tables: whole seeds, of the settings and the rules of the plan."""

from collections import defaultdict
from datetime import datetime
from pathlib import Path

from ship_trl.study.plan.manifest import begun_with
from ship_trl.study.records.layers import LAYERS, read_layers
from ship_trl.study.records.tables import read_tables
from ship_trl.study.rules import digest

FOLDER = Path(__file__).parents[2] / "outputs/confirmatory"


def test_its_seeds_are_whole_and_of_the_plan() -> None:
    tables = read_tables(FOLDER)
    planned, kept = defaultdict(set), defaultdict(set)
    for job in tables.plan["jobs"]:
        planned[job["seed"]].add((job["part"], job["label"], job["arm"]))
    for record, result, _ in tables.by_run():
        kept[record.seed].add((record.part, record.pair, record.arm))
        assert result.profile == "quick" and result.episodes == 600
    assert sorted(planned) == list(range(100, 115))
    # Seeds are run one after another.
    assert list(kept) == sorted(planned)[: len(kept)]
    assert all(kept[seed] == planned[seed] for seed in kept)
    assert {row.seed for row in read_layers(FOLDER / LAYERS)} <= kept.keys()


def test_it_is_judged_by_the_rules_that_it_was_begun_with() -> None:
    seeds, rules = begun_with(FOLDER)
    assert seeds == tuple(range(100, 115))
    assert rules["digest"] == digest()
    committed = rules["commit"].partition(" of ")[2]
    assert datetime.fromisoformat(committed) < datetime.fromisoformat(rules["begun"])
