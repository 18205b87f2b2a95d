"""A study's folder takes nothing that does not belong to it, and keeps what is there."""

import json
from pathlib import Path

import pytest

from ship_trl.config.errors import ConfigError
from ship_trl.study.manifest import NO_PLAN, PLAN, load_plan, write_plan
from ship_trl.study.plan import plan_jobs, to_study


def begin(folder: Path, *overrides: str) -> None:
    config = to_study(["profile=smoke", "reuse=false", "controls=false", f"output={folder}", *overrides])
    write_plan(plan_jobs(config), config)


def test_pairs_and_seeds_may_be_added(tmp_path: Path) -> None:
    begin(tmp_path, "pairs=[high]")
    assert json.loads((tmp_path / PLAN).read_text())["cases"].keys() == {"1", "2"}
    begin(tmp_path, "pairs=[low]", "seeds=3")
    # What the first pair's cases were is still known.
    plan = json.loads((tmp_path / PLAN).read_text())
    assert plan["cases"].keys() == {"1", "2", "3", "4"}
    assert {job["label"] for job in plan["jobs"]} == {"3", "low"}


@pytest.mark.parametrize(
    ("overrides", "said"),
    [
        (["overrides=[learn.lr=0.1]"], "study with other settings \\(learn\\)"),
        (["overrides=[network=five]"], "study with other settings \\(network\\)"),
        (["overrides=[algorithm=n_step]"], "study with other settings \\(algorithm\\)"),
        (["overrides=[colour=true]"], "study with other settings \\(colour\\)"),
        (["first_seed=5"], "study with other settings \\(first_seed\\)"),
    ],
)
def test_other_settings_are_refused(overrides: list[str], said: str, tmp_path: Path) -> None:
    begin(tmp_path)
    before = (tmp_path / PLAN).read_bytes()
    with pytest.raises(ConfigError, match=said):
        begin(tmp_path, *overrides)
    assert (tmp_path / PLAN).read_bytes() == before


def test_a_case_that_was_edited_is_refused(tmp_path: Path) -> None:
    begin(tmp_path)
    plan = json.loads((tmp_path / PLAN).read_text())
    plan["cases"]["4"] = "another"
    (tmp_path / PLAN).write_text(json.dumps(plan))
    with pytest.raises(ConfigError, match=r"study with other settings \(case 4\); allowed: another output="):
        begin(tmp_path)
    begin(tmp_path, "pairs=[high]")  # it does not sail there


@pytest.mark.parametrize("judged", [[], None, 3, ["5"], [0, 1.5], {"0": 1}], ids=str)
def test_damaged_seeds_are_refused_and_do_not_become_one_look(judged: object, tmp_path: Path) -> None:
    begin(tmp_path)
    begun = load_plan(tmp_path)
    assert begun.seeds == (0, 1)
    plan = json.loads((tmp_path / PLAN).read_text())
    (tmp_path / PLAN).write_text(json.dumps(plan | {"judged": judged}))
    with pytest.raises(ConfigError, match=r"folder: .* is not a study's plan"):
        load_plan(tmp_path)
    (tmp_path / PLAN).unlink()
    assert load_plan(tmp_path) == NO_PLAN


def test_arms_of_more_layers_than_the_network_has_are_refused(tmp_path: Path) -> None:
    small = "overrides=['network.conv=[[8,8,4],[8,4,2],[20,9,1]]']"
    with pytest.raises(ConfigError, match="arms: FE4 copies 4 layers, the network has 3; allowed: FE1"):
        begin(tmp_path, small, "arms=[scratch,FE4]")
    assert not list(tmp_path.iterdir())
    begin(tmp_path, small, "arms=[scratch,FE3]")
