"""Studies of one's own cases, pairs and files: planned from the working directory's conf/ as runs are."""

import json
from pathlib import Path

import pytest

from ship_trl.config.errors import ConfigError
from ship_trl.grid.compose import compose_config
from ship_trl.study.manifest import run_config, write_plan
from ship_trl.study.plan import plan_jobs, to_study
from tests.study.commands import own_study


@pytest.fixture(autouse=True)
def _in_a_folder_of_ones_own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    own_study(tmp_path)
    monkeypatch.chdir(tmp_path)


def test_a_file_of_ones_own_is_a_study() -> None:
    config = to_study(["harbour.yaml", "seeds=3"])
    assert (config.folder, config.reuse, config.controls) == (Path("outputs/harbour"), False, False)
    jobs = plan_jobs(config)
    assert {(job.part, job.label, job.arm) for job in jobs} == {
        ("sources", "3", "scratch"), ("pairs", "harbour", "scratch"), ("pairs", "harbour", "FT3")
    }  # fmt: skip
    assert {job.values["target"] for job in jobs if job.part == "pairs"} == {"mine"} and len(jobs) == 9
    write_plan(jobs, config)
    plan = json.loads((config.folder / "study.json").read_text())
    assert plan["cases"].keys() == {"3", "mine"} and plan["question"] == "Help: from case 3?"
    # The kept words plan the same study without the file.
    again = to_study(plan["words"])
    assert again.words == config.words and plan_jobs(again) == jobs


def test_some_arms_on_a_pair_of_the_paper_are_no_study_of_all_its_figures() -> None:
    some, every = (to_study(["pairs=[high]", *words]) for words in (["arms=[scratch,FTW]"], []))
    assert (some.reuse, some.controls, every.reuse, every.controls) == (False, False, True, True)
    assert len(plan_jobs(to_study(["pairs=[low]", "arms=[scratch,FT3]", "seeds=2"]))) == 6


def test_runs_and_studies_take_the_same_files(tmp_path: Path) -> None:
    (tmp_path / "conf/network").mkdir()
    small = "conv: [[8, 8, 4], [8, 4, 2], [8, 9, 1]]\nhidden: 16\nvector_time: 0.0\n"
    (tmp_path / "conf/network/small.yaml").write_text(small)
    run = compose_config("+pair=harbour", "layers=3", "network=small")
    assert (run.source, run.target, len(run.network.conv)) == ("3", "mine", 3)
    config = to_study(["harbour.yaml", "overrides=[network=small]"])
    assert run_config(config).network == run.network


def begin() -> None:
    config = to_study(["harbour.yaml"])
    write_plan(plan_jobs(config), config)


@pytest.mark.parametrize(
    ("name", "text", "said"),
    [
        ("pair/harbour.yaml", "source: '3'\n", "harbour.yaml: must name a source and a target"),
        ("pair/harbour.yaml", "source: a/b.yaml\ntarget: mine\n", "must name a source and a target"),
        ("pair/harbour.yaml", "[3, 4]\n", "must name a source and a target"),
        ("pair/harbour.yaml", "source: '3'\ntarget: sea\n", "pairs: no case or suite sea; allowed: "),
        ("../harbour.yaml", "pairs: [harbour\n", "harbour.yaml: not readable as YAML"),
        ("../harbour.yaml", "pair: harbour\n", "pair: unknown key; allowed here: question, profile"),
        ("../harbour.yaml", 'question: "a\\nb"\n', "question: must be one line of plain text"),
        ("pair/high.yaml", "pair: high\n", "conf/pair/high.yaml: another pair of this name"),
    ],
)
def test_what_is_wrong_in_a_file_is_one_line(name: str, text: str, said: str, tmp_path: Path) -> None:
    (tmp_path / "conf" / name).write_text(text)
    with pytest.raises(ConfigError) as caught:
        begin()
    assert said in str(caught.value) and "\n" not in str(caught.value)
    assert not Path("outputs").exists()
