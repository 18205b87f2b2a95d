"""The case base: retention, retrieval, ranking."""

import json
from dataclasses import replace
from pathlib import Path

import pytest
from filelock import Timeout

from ship_trl.config.paths import conf_files
from ship_trl.config.types import Perturbation, World
from ship_trl.sim.cases import Suite, load_case, load_suite, suite_of
from ship_trl.transfer.casebase import CaseBase, rank


@pytest.fixture
def case(world: World) -> Suite:
    return load_suite("2", world)


@pytest.fixture
def base(tmp_path: Path) -> CaseBase:
    return CaseBase(tmp_path / "base")


def test_what_is_retained_is_found(base: CaseBase, finished_run: Path, case: Suite) -> None:
    assert base.entries() == [] and base.find(case, "scratch", 0, "abc") is None
    stored = base.retain(case, "scratch", 0, "abc", {"best": {"return": 80.0}}, finished_run)
    found = base.find(case, "scratch", 0, "abc")
    assert found == stored and found.policy.read_bytes() == b"weights"
    assert found.scores["best"]["return"] == 80.0
    assert sorted(p.name for p in found.path.iterdir()) == ["config.yaml", "entry.json", "policy.safetensors"]


def test_a_case_that_changed_is_not_found(base: CaseBase, finished_run: Path, case: Suite) -> None:
    base.retain(case, "scratch", 0, "abc", {}, finished_run)
    changed = replace(case.case, heading=80.0)
    assert base.find(suite_of(changed), "scratch", 0, "abc") is None


def test_only_networks_of_the_single_case_represent_it(
    base: CaseBase, finished_run: Path, world: World
) -> None:
    scores, one = {"best": {"return": 80.0}}, load_suite("2", world)
    perturbed = load_suite("2", world, perturbation=Perturbation(own_position=20.0))
    for suite in (load_suite("paper", world), perturbed):
        stored = base.retain(suite, "scratch", 0, suite.fingerprint, scores, finished_run)
        assert base.find(suite, "scratch", 0, suite.fingerprint) == stored
        assert base.representative(one.case) is None
    # Such a network is refused as a source.
    base.retain(one, "QR", 0, "abc", scores, finished_run)
    assert base.representative(one.case) is None
    assert base.retain(one, "scratch", 0, "abc", scores, finished_run) == base.representative(one.case)


def test_half_an_entry_is_passed_over_and_replaced(base: CaseBase, finished_run: Path, case: Suite) -> None:
    place = base.entry_folder(case, "scratch", 0, "abc")
    place.mkdir(parents=True)
    (place / "entry.json").write_text('{"case": ')
    assert base.entries() == [] and base.find(case, "scratch", 0, "abc") is None
    base.retain(case, "scratch", 0, "abc", {}, finished_run)
    assert base.find(case, "scratch", 0, "abc") is not None


def test_ranking_by_similarity_and_by_distance(world: World) -> None:
    cases = {name: load_case(name, world) for name in sorted(conf_files("case"))}
    target = cases.pop("new")
    ranking = rank(target, list(cases.values()), world)
    assert ranking[0].case.name == "2"
    found = [match.measured["similarity"] for match in ranking]
    assert found == sorted(found, reverse=True)
    ranking = rank(target, list(cases.values()), world, by="distance")
    found = [match.measured["distance"] for match in ranking]
    assert found == sorted(found)


def test_a_lock_is_of_one_entry_and_leaves_the_others_free(tmp_path: Path, world: World) -> None:
    base, case = CaseBase(tmp_path), load_suite("1", world)
    with base.lock(case, "scratch", 0, "aa"):
        other = base.lock(case, "scratch", 0, "aa")
        with pytest.raises(Timeout):
            other.acquire(timeout=0.01)
        with base.lock(case, "scratch", 1, "aa").acquire(timeout=0.01):
            pass
    with base.lock(case, "scratch", 0, "aa").acquire(timeout=0.01):
        pass
    assert base.entries() == []


def test_an_entry_cannot_name_another_path(base: CaseBase, finished_run: Path, case: Suite) -> None:
    stored = base.retain(case, "scratch", 0, "abc", {}, finished_run)
    values = json.loads((stored.path / "entry.json").read_text())
    elsewhere = values | {"case": "../../private", "config_hash": "../../../x"}
    (stored.path / "entry.json").write_text(json.dumps(elsewhere))
    assert [one.path for one in base.entries()] == [stored.path]
    for more in ({"path": "private"}, {"arm": "\x1b[2J"}, {"fingerprint": ["a"]}, {"seed": "../0"}):
        (stored.path / "entry.json").write_text(json.dumps(values | more))
        assert base.entries() == []
