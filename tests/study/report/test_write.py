"""The command that makes a report: tables, figures and page, what is broken named, and alike each time."""

import csv
import html.parser
import io
import json
import os
import re
import resource
import shutil
import subprocess
import sys
from collections.abc import Callable
from contextlib import redirect_stderr, redirect_stdout
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest

from ship_trl.files.record import SourceReturns
from ship_trl.study.metrics import LATER
from ship_trl.study.report import write
from ship_trl.study.statistics import Estimate
from studies.paper.claims import ALL
from studies.paper.contrasts import beats
from studies.paper.judge import (
    CONCLUSION,
    Answer,
    Claim,
    Finding,
    Grade,
    Part,
    Verdict,
    judge,
    min_detectable_effect,
)
from studies.paper.report import families, in_a_sentence, percent, scale_of
from tests.command import ROOT, files
from tests.command import report as main
from tests.study.synthetic import learning, make_study, write_planned, write_run, write_study

MARKUP = "<img src=x onerror=alert(1)>"
# Files of an earlier report that go, and files that stay.
GONE, STAYING = ["pair_low.png", "pair_low.pdf", "reuse.png", "forest_3.pdf"], ["mine.png", "pair_low.txt"]
# A study that was not begun with rules is judged when it is asked to be.
CLAIMS = "--claims", str(ROOT / "studies/paper/claims.py")
# From the worst to the best: claims H5d and H5k hold, and H5e is open.
ARMS = ("FT1", "FE2", "scratch", "FE1", "FT2", "FTW")
FEW = ("scratch", "FE1")


@dataclass(frozen=True)
class Reported:
    """A study's folder with its report, and what the report printed."""

    folder: Path
    out: str
    err: str

    def read(self, name: str) -> str:
        return (self.folder / "report" / name).read_text()

    def rows(self, name: str) -> list[dict[str, str]]:
        return list(csv.DictReader(io.StringIO(self.read(f"{name}.csv"))))

    def claims(self) -> dict[str, list[dict[str, str]]]:
        """The rows of each claim."""
        found: dict[str, list[dict[str, str]]] = {}
        for row in self.rows("claims"):
            found.setdefault(row["claim"], []).append(row)
        return found


def report(folder: Path) -> Reported:
    with redirect_stdout(io.StringIO()) as out, redirect_stderr(io.StringIO()) as err:
        main([str(folder), *CLAIMS])
    return Reported(folder, out.getvalue(), err.getvalue())


@pytest.fixture(scope="module")
def reported(tmp_path_factory: pytest.TempPathFactory) -> Reported:
    folder = tmp_path_factory.mktemp("study")
    write_study(folder, 5, arms=ARMS, noise=0.03)
    return report(folder)


@pytest.fixture(scope="module")
def odd(tmp_path_factory: pytest.TempPathFactory) -> Reported:
    """Seven planned seeds of two arms: the sixth is broken in parts, and the seventh has no run."""
    folder = tmp_path_factory.mktemp("odd")
    write_study(folder, 6, arms=FEW)
    place = folder / "pairs/high"
    (place / "FE1/seed=5/curve.csv").write_text("episode")
    shutil.copytree(place / "FE1/seed=0", folder / "pairs_old/high/FE1/seed=0")
    (folder / "pairs" / MARKUP / "scratch/seed=0").mkdir(parents=True)
    for seed, precision in ((0, "bfloat16"), (1, "float32")):
        path = place / f"FE1/seed={seed}/result.json"
        path.write_text(json.dumps(json.loads(path.read_text()) | {"precision": precision, "device": "cpu"}))
    jobs = [
        {"name": "", "stage": 0, "part": "pairs", "label": "high", "arm": arm, "seed": seed}
        for arm in FEW
        for seed in range(7)
    ]
    (folder / "study.json").write_text(json.dumps({"settings": {}, "cases": {}, "jobs": jobs}))
    with (folder / "earlier.csv").open("w", newline="") as file:
        rows = [("H5a", "contradicted", "Other words | <b>"), ("OLD", "supported", "")]
        csv.writer(file).writerows([("claim", "claim's verdict", "sentence"), *rows])
    (folder / "report").mkdir()
    for name in [*GONE, *STAYING]:
        (folder / "report" / name).touch()
    drawings, two = write.drawings, ("pair_high", "differences")
    with pytest.MonkeyPatch.context() as patch:  # each takes a second
        patch.setattr(write, "drawings", lambda study: {key: drawings(study)[key] for key in two})
        return report(folder)


def test_tables_and_figures_lie_beside_it(reported: Reported) -> None:
    rows = reported.rows("runs")
    assert len(rows) == 30 and 0 < float(rows[0]["area"]) < 1
    arms = {row["arm"]: row for row in reported.rows("arms")}
    assert float(arms["FTW"]["area"]) > float(arms["scratch"]["area"])
    low, value, high = (float(arms["FTW"][f"transfer ratio{end}"]) for end in (" low", "", " high"))
    assert 0 < low < value < high and arms["scratch"]["transfer ratio"] == ""
    for name in ("pair_high", "differences", "gains", "gains_forest"):
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
    assert names == {"arms.csv", "effects.csv", "index.html", "runs.csv", "table_2.csv"}
    assert (tmp_path / "arms.csv").read_text() == reported.read("arms.csv")
    page = (tmp_path / "index.html").read_text()
    assert "<h2>Scores by arm</h2>" in page and "claim" not in page.partition("</style>")[2]
    *headlines, last = capsys.readouterr().out.splitlines()
    assert (
        len(headlines) == len(ARMS) - 1 and "FE1 against scratch, case 1 to case 2, 5 seeds" in headlines[0]
    )
    assert last == f"30 runs, 0 left out; {tmp_path / 'index.html'}"


def test_a_claims_file_may_be_ones_own(
    reported: Reported, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(write, "draw_all", lambda *_: [])
    mine = tmp_path / "mine.py"
    mine.write_text(
        "from ship_trl.study.claims import Claims, Verdicts\n"
        "def judge(study, folder):\n"
        "    return Verdicts([{'claim': 'M1', 'runs': len(study.records)}], ['M1 holds'], {})\n"
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
    assert not left & set(GONE) and {*STAYING, "pair_high.png", "differences.pdf"} <= left


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
    assert "Missing: 2 planned runs" in odd.read("index.html") and odd.read("index.html").count("<li>") == 3
    assert "missing: 2 planned runs" in odd.out
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


class Page(html.parser.HTMLParser):
    """Tags that were opened and not closed, and what the page would fetch."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.fetched: list[str] = []

    def handle_starttag(self, tag: str, attributes: list[tuple[str, str | None]]) -> None:
        if tag not in ("meta", "link", "img", "br"):
            self.open.append(tag)
        self.fetched += [v or "" for k, v in attributes if k in ("src", "srcset", "href")]

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag


def verdict(reported: Reported, name: str) -> str:
    """The row of a claim of a figure on the page."""
    (row,) = re.findall(rf"<tr><td>{name}</td>.*?</tr>", reported.read("index.html"), re.DOTALL)
    return str(row)


def test_the_page_is_whole_and_needs_nothing_else(reported: Reported) -> None:
    read, text = Page(), reported.read("index.html")
    read.feed(text)
    assert read.open == [] and all(link.startswith("data:") for link in read.fetched)
    assert "30 runs of the profile quick, 60 episodes each, 5 seeds" in text
    # What is too wide for a narrow screen is scrolled in itself.
    assert len(re.findall(r"<table", text)) == len(re.findall(r'<div class="wide"><table', text))
    assert text.count('<section class="card">') == 5 and 'class="verdict supported"' in text
    # Of each look it says what it could see; five seeds without a plan are all.
    seen = re.search(r"level 0.02500, which detects a difference of\s+([\d.]+) standard", text)
    assert seen and float(seen[1]) == pytest.approx(min_detectable_effect(5, 0.025), abs=0.05)


def test_the_page_begins_with_what_is_decided(reported: Reported) -> None:
    rows = {name: row for name, (row, *_) in reported.claims().items() if row["decided after seeds"]}
    top, _, _ = reported.read("index.html").partition("The five conclusions")
    assert f"{len(rows)} of {len(ALL)} claims decided" in top and len(rows) > 0
    told = re.findall(r'<p><span class="verdict (\w+)">\1</span> (\w+): ', top)
    assert {name: word for word, name in told} == {n: row["claim's verdict"] for n, row in rows.items()}


def test_the_page_has_verdict_and_grade_of_each_claim(reported: Reported) -> None:
    text, graded = (
        reported.read("index.html"),
        {n: row["grade"] for n, (row, *_) in reported.claims().items()},
    )
    every = [graded[claim.name] for claim in ALL]
    counts = f"Grades: {', '.join(f'{every.count(grade)} {grade}' for grade in Grade)}."
    assert "95 % after 5 seeds" in text and counts in text and counts in reported.out
    assert "FT2 &lt; FT3 &lt; FT4 &lt; FTW" in verdict(reported, "H5h")
    assert {name for name, grade in graded.items() if grade} == {claim.name for claim in ALL}
    (first, *_) = reported.claims()["H5d"]
    assert f'<span class="grade">{first["grade"]}</span>' in verdict(reported, "H5d")
    assert first["part"] in {*Part}


def test_a_claim_without_runs_is_called_so_everywhere(reported: Reported) -> None:
    # The study has pair high alone: figure 7 is of pair lowest.
    cells = verdict(reported, "H7d")
    assert ">no runs</span>" in cells and ">undetermined</span>" in cells and "No runs." in cells
    (row,) = reported.claims()["H7d"]
    assert row["claim's verdict"] == "no runs" and row["contrast"] == row["estimate"] == row["verdict"] == ""
    assert "inconclusive" not in cells
    assert "\nH5d " in reported.out and "\nH7d " not in reported.out and reported.out.count("no runs: ") == 1


def test_what_an_earlier_study_said_stands_beside(odd: Reported) -> None:
    said = "rules, of &#34;Other words | &lt;b&gt;&#34;: contradicted."
    assert said in verdict(odd, "H5a") and odd.read("index.html").count(said) == 1


@pytest.mark.parametrize("text", ["a,b\n1,2\n", "claim,claim's verdict,sentence\nH5a,<b>,x\n"])
def test_earlier_verdicts_that_cannot_be_read_are_refused(
    text: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    write_study(tmp_path, 1, arms=("scratch",))
    (tmp_path / "earlier.csv").write_text(text)
    with pytest.raises(SystemExit):
        main([str(tmp_path), *CLAIMS])
    assert f"ship_trl: folder: {tmp_path / 'earlier.csv'} is not" in capsys.readouterr().err


def finding(value: float, reach: float = 0.05, metric: str = "area") -> Finding:
    return Finding(Estimate(value, value - reach, value + reach, 15, "a", metric, 0.01, 0.99, margin=0.03))


def test_each_contrast_has_a_bar_on_the_scale_of_its_unit(reported: Reported) -> None:
    rows = [row for row in reported.rows("claims") if row["contrast"]]
    bars = re.findall(r'<svg class="bar bar-(\w+)"', reported.read("index.html"))
    assert sorted(bars) == sorted(row["verdict"] for row in rows)
    parts = [finding(0.1), finding(1.5, metric="spread"), finding(0.9, metric="start")]
    ((title, _, scales),) = families([Answer(Claim("H1", "5", "", []), parts)])
    assert title == "Figure 5" and set(scales) == {"difference", "spread", "start"}
    assert scales["spread"][1] > 1.5 > scales["difference"][1]


def test_a_wide_interval_leaves_room_to_see_the_others() -> None:
    scale = scale_of([finding(0.1, reach=9.0), finding(0.05)])
    assert -0.3 < scale[0] < -0.2 and 0.2 < scale[1] < 0.3
    assert percent(-9, scale) == 0 and percent(9, scale) == 100 and 40 < percent(0, scale) < 60
    for reach in (np.inf, 0.0):
        low, high = scale_of([finding(0.1, reach)])
        assert -1 < low < 0 < high < 1
    assert Estimate(0.1, -np.inf, np.inf).interval() == "unbounded"


def test_of_open_claims_it_is_said_how_many_seeds_they_want(reported: Reported) -> None:
    rows = {name: row for name, (row, *_) in reported.claims().items()}
    wanted = {name: row["seeds wanted"] for name, row in rows.items() if row["seeds wanted"]}
    assert wanted and not any(rows[name]["decided after seeds"] for name in wanted)
    for name in (claim.name for claim in ALL if claim.figure != CONCLUSION):
        assert (f" {wanted.get(name)} seeds would tell" in verdict(reported, name)) is (name in wanted)


def test_a_claim_open_by_the_adjustment_alone_says_what_could_be_seen() -> None:
    made = make_study({("pairs", "high", "FE1"): 0.75, ("pairs", "high", "FE2"): 0.7}, sd=0.06)
    family = [Claim("A", "5", "", [beats("high", "FE1", "FE2")])]
    (one,) = judge(made, family, 15, 0.025)
    # As many other claims as its p can just not bear.
    others = [replace(family[0], tests=[beats("high", "FE2", "FE1")])] * (int(0.025 / one.p) + 1)
    found, *_ = judge(made, [*family, *others], 15, 0.025)
    assert found.word == "inconclusive" and found.findings[0].verdict is Verdict.supported
    assert "Could see differences from" in in_a_sentence(found, {})


def test_runs_that_were_not_computed_alike_are_counted(odd: Reported) -> None:
    text = odd.read("index.html")
    assert re.search(r"Not computed alike, precision: bfloat16 \(1\), float32 \(\d+\)\.", text)
    assert "alike, device" not in text
    assert re.search(r"<th>device</th><td>cpu \(\d+\)</td>", text)


def test_an_untrusted_study_puts_no_markup_into_the_page(odd: Reported) -> None:
    read = Page()
    read.feed(odd.read("index.html"))
    assert "&lt;img src=x" in odd.read("index.html") and not any(place == "x" for place in read.fetched)
