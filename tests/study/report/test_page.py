"""The page and the verdicts: whole, readable on a narrow screen, and what is said of each claim."""

import html.parser
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from ship_trl.study.statistics import Estimate
from studies.paper.claims import ALL
from studies.paper.contrasts import beats
from studies.paper.judge import Answer, Claim, Finding, Grade, Part, Verdict, judge, min_detectable_effect
from studies.paper.report import families, in_a_sentence, percent, scale_of
from tests.command import report as main
from tests.study.report.conftest import Reported
from tests.study.synthetic import make_study, write_study


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
    """The line of a claim in verdicts.md."""
    lines = reported.read("verdicts.md").splitlines()
    (line,) = (line for line in lines if line.startswith(f"| {name} "))
    return line


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


def test_verdicts_and_grades_are_a_markdown_table(reported: Reported) -> None:
    head, _, counts, _, *lines = reported.read("verdicts.md").splitlines()
    graded = {name: row["grade"] for name, (row, *_) in reported.claims().items()}
    every = [graded[claim.name] for claim in ALL]
    assert "95 % after 5 seeds" in head
    assert counts == f"Grades: {', '.join(f'{every.count(grade)} {grade}' for grade in Grade)}."
    assert counts in reported.read("index.html") and counts in reported.out
    assert len(lines) == 2 + len(ALL) and all(line.count(" | ") == 4 for line in lines)
    assert "FT2 &lt; FT3 &lt; FT4 &lt; FTW" in verdict(reported, "H5h")
    assert {name for name, grade in graded.items() if grade} == {claim.name for claim in ALL}
    (first, *_) = reported.claims()["H5d"]
    assert verdict(reported, "H5d").split(" | ")[2] == first["grade"] and first["part"] in {*Part}


def test_a_claim_without_runs_is_called_so_everywhere(reported: Reported) -> None:
    # The study has pair high alone: figure 7 is of pair lowest.
    line = verdict(reported, "H7d")
    assert line.startswith("| H7d | no runs | undetermined | ") and line.endswith(" | No runs. |")
    (row,) = reported.claims()["H7d"]
    assert row["claim's verdict"] == "no runs" and row["contrast"] == row["estimate"] == row["verdict"] == ""
    (cells,) = re.findall(r"<tr><td>H7d</td>.*?</tr>", reported.read("index.html"), re.DOTALL)
    assert ">no runs</span>" in cells and "inconclusive" not in cells
    assert "\nH5d " in reported.out and "\nH7d " not in reported.out and reported.out.count("no runs: ") == 1


def test_what_an_earlier_study_said_stands_beside(odd: Reported) -> None:
    lines = odd.read("verdicts.md").splitlines()
    told = [row.split(" | ")[0] for row in lines if 'rules, of "Other words / &lt;b>": contradicted.' in row]
    assert told == ["| H5a"]


@pytest.mark.parametrize("text", ["a,b\n1,2\n", "claim,claim's verdict,sentence\nH5a,<b>,x\n"])
def test_earlier_verdicts_that_cannot_be_read_are_refused(
    text: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    write_study(tmp_path, 1, arms=("scratch",))
    (tmp_path / "earlier.csv").write_text(text)
    with pytest.raises(SystemExit):
        main([str(tmp_path)])
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
    for line in reported.read("verdicts.md").splitlines()[6:]:
        name = line.split(" | ")[0].removeprefix("| ")
        assert (f" {wanted.get(name)} seeds would tell" in line) is (name in wanted)


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
    assert re.search(r"computed with .*device: cpu \(\d+\); precision: bfloat16 \(1\), float32", text)


def test_an_untrusted_study_puts_no_markup_into_the_page(odd: Reported) -> None:
    read = Page()
    read.feed(odd.read("index.html"))
    assert "&lt;img src=x" in odd.read("index.html") and not any(place == "x" for place in read.fetched)
