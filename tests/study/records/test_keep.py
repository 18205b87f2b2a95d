"""A study's copy: what it holds, and how a study goes on from it."""

import csv
import json
import lzma
import shutil
from pathlib import Path

import numpy as np
import pytest

from ship_trl.study.report import write
from ship_trl.study.study import read_study
from tests.command import files, keep, report
from tests.study.commands import SMALL, learned, study

FILES = ["curves.csv.xz", "runs.csv", "study.json"]


def test_what_the_report_needs_comes_back(whole_study: Path, copy: Path, tmp_path: Path) -> None:
    keep(["--restore", str(copy), str(tmp_path / "again")])
    before, after = (read_study(folder) for folder in (whole_study, tmp_path / "again"))
    assert before.records.keys() == after.records.keys() and len(after.records) == 9 and not after.broken
    assert before.plan.seeds == after.plan.seeds and before.plan.rules == after.plan.rules
    for key, record in before.records.items():
        other = after.records[key]
        assert record.best_known == other.best_known
        assert record.random_return == other.random_return
        np.testing.assert_allclose(record.draws, other.draws, atol=5e-4)
        np.testing.assert_array_equal(record.training.epsilon, other.training.epsilon)
        for kind in ("training", "greedy"):
            one, two = getattr(record, kind), getattr(other, kind)
            np.testing.assert_allclose(one.returns, two.returns, atol=5e-4)
            np.testing.assert_allclose(one.dcpa, two.dcpa, atol=0.05)
            np.testing.assert_array_equal(one.goal, two.goal)
            np.testing.assert_array_equal(one.collision, two.collision)
        np.testing.assert_array_equal(record.greedy.episode, other.greedy.episode)
    result = json.loads((tmp_path / "again/pairs/high/FTW/seed=2/result.json").read_text())
    original = json.loads((whole_study / "pairs/high/FTW/seed=2/result.json").read_text())
    for found in (result, original):
        del found["draws"], found["source_network"]
    assert result == original
    # Once more, it is the same copy.
    keep([str(tmp_path / "again"), str(tmp_path / "second")])
    assert files(tmp_path / "second") == files(copy)


def test_a_copy_is_small_and_has_no_paths_of_this_machine(copy: Path, whole_study: Path) -> None:
    assert sorted(path.name for path in copy.iterdir()) == FILES
    before = files(copy)
    text = b"".join(before[name] for name in FILES[1:]) + lzma.decompress(before[FILES[0]])
    assert b"somebody" not in text and str(whole_study.parent).encode() not in text
    with (copy / "runs.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert [(row["part"], row["arm"], row["seed"]) for row in rows] == [
        (part, arm, str(seed))
        for seed in range(3)
        for part, arm in (("pairs", "FTW"), ("pairs", "scratch"), ("sources", "scratch"))
    ]
    assert rows[0]["source_network"] == "case_base/1/scratch/seed=0-abc/policy.safetensors"
    keep([str(whole_study), str(copy)])
    assert files(copy) == before


def test_a_further_seed_adds_to_the_curves_and_leaves_what_was_there(
    whole_study: Path, copy: Path, tmp_path: Path
) -> None:
    for run in whole_study.rglob("seed=2"):
        shutil.rmtree(run)
    keep([str(whole_study), str(tmp_path / "before")])
    fewer, more = (files(folder)[FILES[0]] for folder in (tmp_path / "before", copy))
    assert len(fewer) < len(more) and more.startswith(fewer)


def test_what_is_not_whole_is_left_out_of_a_copy(whole_study: Path, tmp_path: Path) -> None:
    (whole_study / "pairs/high/FTW/seed=1/curve.csv").write_text("episode\n")
    (whole_study / "pairs/high/FTW/seed=2/result.json").unlink()
    keep([str(whole_study), str(tmp_path / "copy")])
    # Seeds that lack a run would begin with networks that are no more.
    keep(["--restore", str(tmp_path / "copy"), str(tmp_path / "again")])
    assert {key[3] for key in read_study(tmp_path / "again").records} == {0}


def test_the_report_of_a_copy_is_that_of_the_study(
    whole_study: Path, copy: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(write, "drawings", lambda _: {})
    for folder in (whole_study, copy):
        report([str(folder)])
    before, after = (files(folder / "report") for folder in (whole_study, copy))
    assert "index.html" in before and before == after
    assert sorted(path.name for path in copy.iterdir()) == [*FILES[:1], "report", *FILES[1:]]


@pytest.mark.long
def test_a_study_goes_on_from_its_copy(whole: Path, tmp_path: Path) -> None:
    keep([str(whole / "outputs/smoke_study"), str(tmp_path / "copy")])
    folder = tmp_path / "outputs/smoke_study"
    keep(["--restore", str(tmp_path / "copy"), str(folder)])
    before = files(folder / "pairs")
    # Nothing to do, nothing done.
    assert '"missing": 0' in study(*SMALL, folder=tmp_path).stdout
    # One more seed, and one more arm, for which the sources of all seeds are needed again.
    done = study(*SMALL, "seeds=3", "arms=[scratch,FTW,FE1]", folder=tmp_path)
    assert done.stdout.count("policy.safetensors is missing, and other runs begin with it") == 2
    assert "8 of 12 runs to do" in done.stdout
    assert {name: data for name, data in files(folder / "pairs").items() if name in before} == before
    again = learned(tmp_path)
    for name, data in learned(whole).items():
        if "sources/" in name or "case_base/1/" in name:
            assert again[name] == data
    # No source was trained where it does not belong.
    assert sorted(path.name for path in (folder / "pairs").iterdir()) == [".locks", "high"]


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["study", "study"], "copy: study holds a study; allowed: another folder"),
        (["copy", "new"], "folder: copy holds a study's tables; allowed: a study's folder of runs"),
        (["--restore", "copy", "study"], "study is there already; allowed: a new one"),
        (["--restore", "study", "new"], "copy: study/runs.csv is not the file that study.json was kept with"),
    ],
)
def test_what_is_there_is_kept(
    arguments: list[str],
    said: str,
    copy: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "taken").write_text("mine")
    before = files(tmp_path)
    capsys.readouterr()
    with pytest.raises(SystemExit) as ended:
        keep(arguments)
    told = capsys.readouterr().err
    assert ended.value.code == 1
    assert told.startswith("ship_trl: ") and said in told and told.count("\n") == 1
    assert files(tmp_path) == before


def test_no_complete_seed_is_nothing_to_go_on_from(
    whole_study: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for seed in range(3):
        (whole_study / f"sources/1/scratch/seed={seed}/result.json").unlink()
    keep([str(whole_study), str(tmp_path / "copy")])
    with pytest.raises(SystemExit):
        keep(["--restore", str(tmp_path / "copy"), str(tmp_path / "again")])
    assert "has no seed with all its runs" in capsys.readouterr().err
    assert not (tmp_path / "again").exists()
