"""The command that makes the report: whole, with what is broken named, and alike each time."""

import csv
import os
import resource
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from ship_trl.files.record import SourceReturns
from ship_trl.study.metrics import LATER
from ship_trl.study.report import write
from tests.command import ROOT, files
from tests.command import report as main
from tests.study.report.conftest import GONE, STAYING, Reported
from tests.study.synthetic import learning, write_planned, write_run, write_study


def test_tables_and_figures_lie_beside_it(reported: Reported) -> None:
    rows = reported.rows("runs")
    assert len(rows) == 30 and 0 < float(rows[0]["area"]) < 1
    arms = {row["arm"]: row for row in reported.rows("arms")}
    assert float(arms["FTW"]["area"]) > float(arms["scratch"]["area"])
    low, value, high = (float(arms["FTW"][f"transfer ratio{end}"]) for end in (" low", "", " high"))
    assert 0 < low < value < high and arms["scratch"]["transfer ratio"] == ""
    for name in ("pair_high", "differences", "times", "gains", "gains_forest"):
        for ending in ("png", "pdf"):
            assert (reported.folder / f"report/{name}.{ending}").stat().st_size > 3_000


def test_a_study_that_measured_its_sources_has_further_columns(
    reported: Reported, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The table of another has its old columns; its page says what each arm gained all the same."""
    columns = reported.read("arms.csv").partition("\n")[0].split(",")
    assert not {*LATER, "forward transfer"} & {*columns}
    assert "<th>forward transfer</th>" in reported.read("index.html")
    monkeypatch.setattr(write, "draw_all", lambda *_: [])
    rng, source = np.random.default_rng(0), SourceReturns(90.0, -100.0, 20.0, -10.0, -100.0, 100.0)
    for seed in range(5):
        write_run(tmp_path / "pairs", learning(rng, 60, 0.5), seed=seed)
        write_run(tmp_path / "pairs", learning(rng, 60, 0.8), arm="FT3", seed=seed, on_source=source)
    main([str(tmp_path)])
    with (tmp_path / "report/arms.csv").open(newline="") as file:
        arms = {row["arm"]: row for row in csv.DictReader(file)}
    assert arms["FT3"]["forgetting"] == "0.5" and arms["scratch"]["forgetting"] == ""
    low, value, high = (float(arms["FT3"][f"forward transfer{end}"]) for end in (" low", "", " high"))
    assert 0 < low < value < high < 1 and arms["scratch"]["forward transfer"] == ""
    assert "<th>forgetting</th>" in (tmp_path / "report/index.html").read_text()


def test_without_claims_there_are_tables_and_figures_and_no_verdicts(
    reported: Reported, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(write, "draw_all", lambda *_: [])
    write.report(reported.folder, tmp_path)
    names = {path.name for path in tmp_path.iterdir()}
    assert names == {"arms.csv", "index.html", "runs.csv", "table_2.csv"}
    assert (tmp_path / "arms.csv").read_text() == reported.read("arms.csv")
    page = (tmp_path / "index.html").read_text()
    assert "<h2>Arms</h2>" in page and "claim" not in page.partition("</style>")[2]
    assert capsys.readouterr().out == f"30 runs, 0 left out; {tmp_path / 'index.html'}\n"


def test_a_claims_file_may_be_ones_own(
    reported: Reported, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(write, "draw_all", lambda *_: [])
    mine = tmp_path / "mine.py"
    mine.write_text(
        "from ship_trl.study.claims import Claims, Verdicts\n"
        "def judge(study, folder):\n"
        "    return Verdicts([{'claim': 'M1', 'runs': len(study.records)}], 'M1', ['M1 holds'], {})\n"
        "def claims():\n"
        "    return Claims(judge)\n"
    )
    line = [str(reported.folder), "--output", str(tmp_path / "out"), "--claims"]
    main([*line, str(mine)])
    assert capsys.readouterr().out.startswith("M1 holds\n")
    assert (tmp_path / "out/claims.csv").read_text() == "claim,runs\nM1,30\n"
    mine.write_text("def claims():\n    return 3\n")
    for path, said in ((mine, "must return"), (tmp_path / "none.py", "cannot be imported")):
        with pytest.raises(SystemExit):
            main([*line, str(path)])
        error = capsys.readouterr().err
        assert error.startswith("ship_trl: --claims: ") and said in error and error.count("\n") == 1


def test_figures_of_an_earlier_report_go_and_other_files_stay(odd: Reported) -> None:
    left = {path.name for path in (odd.folder / "report").iterdir()}
    assert not left & set(GONE) and {*STAYING, "pair_high.png", "times.pdf"} <= left


@pytest.mark.long
def test_the_first_seeds_are_shown_as_if_there_were_no_others(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    six, few, five, other = (tmp_path / name for name in ("six", "few", "five", "other"))
    write_study(six, seeds=6)
    for seeds in ("0", "7"):
        with pytest.raises(SystemExit):
            main([str(six), "--seeds", seeds, "--output", str(other)])
        assert capsys.readouterr().err == (
            f"ship_trl: --seeds: must be from 1 to 6, as planned, got {seeds}\n"
        )
    assert not other.exists()
    main([str(six), "--seeds", "5", "--output", str(few)])
    assert "Claims are those" not in capsys.readouterr().out
    for folder in six.rglob("seed=5"):
        shutil.rmtree(folder)
    main([str(six), "--output", str(five)])
    assert files(few) == files(five)


def test_what_is_broken_is_named_and_the_next_look_is_not_judged(odd: Reported) -> None:
    assert odd.err.count("left out") == 3 and "11 runs, 3 left out" in odd.out
    assert "pairs_old is no part of a study" in odd.err
    # A seventh seed of each of two arms; what is broken is named, not missing.
    assert (
        "2 planned runs are missing" in odd.read("index.html") and odd.read("index.html").count("<li>") == 3
    )
    assert "2 planned runs are missing" in odd.out
    assert "the look after 5 seeds; figures and arms.csv have 1 more" in odd.out
    assert {row["seeds"] for row in odd.rows("claims") if row["contrast"]} == {"5"}


@pytest.mark.parametrize(
    ("folder", "said"),
    [("none", "no folder "), ("empty", "no finished run below"), ("old/pairs", "has runs but no study")],
)
def test_nothing_to_report_is_one_line(
    folder: str, said: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "empty").mkdir()
    write_study(tmp_path / "old", seeds=1)
    with pytest.raises(SystemExit) as caught:
        main([str(tmp_path / folder)])
    error = capsys.readouterr().err
    assert caught.value.code == 1 and error.startswith("ship_trl: folder: ")
    assert error.count("\n") == 1 and said in error


def fifteen_seeds(folder: Path) -> int:
    write_study(folder, seeds=15, episodes=600, pairs=("high", "low", "lowest"))
    return 450


def whole_study(folder: Path) -> int:
    """All parts: pairs, reuse with its sources, controls."""
    return write_planned(folder, 5)


@pytest.mark.long
@pytest.mark.parametrize("made", [fifteen_seeds, whole_study])
def test_450_runs_take_less_than_a_minute_and_a_gibibyte_without_torch(
    made: Callable[[Path], int], tmp_path: Path
) -> None:
    assert made(tmp_path) >= 450
    code = (
        "import sys; from tests.command import report as main; main([sys.argv[1]]);"
        "assert 'torch' not in sys.modules;"
        # In KiB, of this process alone: getrusage begins with what the parent had.
        "print(next(l for l in open('/proc/self/status') if l.startswith('VmHWM')).split()[1])"
    )
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    done = subprocess.run(
        [sys.executable, "-c", code, str(tmp_path)],
        env=os.environ | {"PYTHONPATH": str(ROOT), "OMP_NUM_THREADS": "1"},
        capture_output=True,
        text=True,
        check=True,
    )
    assert int(done.stdout.split()[-1]) < 2**20
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    # The processor's seconds: how long it takes on a busy machine says nothing of the report.
    assert after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime < 60


def test_a_report_never_goes_into_the_studys_own_folder(
    reported: Reported, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as caught:
        main([str(reported.folder), "--output", str(reported.folder / "report/..")])
    assert caught.value.code == 1
    assert "is the study's own folder" in capsys.readouterr().err
