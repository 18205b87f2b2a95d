"""The page: whole, readable on a narrow screen, and what it says of each claim."""

import base64
import csv
import html.parser
import re
import struct
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from ship_trl.cli.report import main
from ship_trl.study.claims.grades import Grade, Part
from ship_trl.study.claims.kinds import Hypothesis, beats
from ship_trl.study.claims.verdicts import ALL, Answer, judge
from ship_trl.study.compare import Finding, Verdict
from ship_trl.study.report.page import families, in_a_sentence, scale_of
from ship_trl.study.statistics import Estimate, min_detectable_effect
from tests.study.report.conftest import Odd
from tests.study.synthetic import make_study


class Page(html.parser.HTMLParser):
    """Tags that were opened and not closed, and what the page would fetch."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.fetched: list[str] = []

    def handle_starttag(self, tag: str, attributes: list[tuple[str, str | None]]) -> None:
        if tag not in ("meta", "link", "img", "source", "br"):
            self.open.append(tag)
        self.fetched += [v or "" for k, v in attributes if k in ("src", "srcset", "href")]

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag


def page(study: Path) -> str:
    return (study / "report/index.html").read_text()


def claims(study: Path) -> list[dict[str, str]]:
    with (study / "report/claims.csv").open(newline="") as file:
        return list(csv.DictReader(file))


def verdict(study: Path, name: str) -> str:
    """The line of a claim in verdicts.md."""
    lines = (study / "report/verdicts.md").read_text().splitlines()
    (line,) = (line for line in lines if line.startswith(f"| {name} "))
    return line


def test_the_page_is_whole_and_needs_nothing_else(study: Path) -> None:
    read, text = Page(), page(study)
    read.feed(text)
    assert read.open == [] and all(link.startswith("data:") for link in read.fetched)
    assert "50 runs of the profile quick, 60 episodes each, 5 seeds" in text
    # What is too wide for a narrow screen is scrolled in itself.
    assert len(re.findall(r"<table", text)) == len(re.findall(r'<div class="wide"><table', text))
    assert text.count('<section class="card">') == 5 and 'class="verdict supported"' in text


def test_each_figure_has_a_form_for_narrow_screens(study: Path) -> None:
    text = page(study)
    found = re.findall(
        r'<picture>\n<source media="\(max-width: 64rem\)" srcset="data:image/png;base64,([^"]*)">\n'
        r'<img src="data:image/png;base64,([^"]*)"',
        text,
    )
    assert len(found) == text.count("<img ") == 6

    def size(data: str) -> tuple[int, int]:
        # In a PNG width and height come after its mark and the head of its first part.
        return struct.unpack(">II", base64.b64decode(data)[16:24])

    for narrow, wide in found:
        assert size(narrow)[0] < 700 < 1200 < size(wide)[0]


def test_verdicts_are_a_markdown_table(study: Path) -> None:
    head, _, counts, _, *lines = (study / "report/verdicts.md").read_text().splitlines()
    assert "95 % after 5 seeds" in head and counts.startswith("Grades: ")
    assert len(lines) == 2 + len(ALL) and all(line.count(" | ") == 4 for line in lines)
    assert "FT2 &lt; FT3 &lt; FT4 &lt; FTW" in verdict(study, "H5h")


def test_the_page_begins_with_what_is_decided(study: Path) -> None:
    rows = {row["claim"]: row for row in claims(study) if row["decided after seeds"]}
    top, _, _ = page(study).partition("The five conclusions")
    assert f"{len(rows)} of {len(ALL)} claims decided" in top and len(rows) > 0
    assert "<h2>Gains of the pairs in greedy returns</h2>" in top and top.count("<img ") == 1
    told = re.findall(r'<p><span class="verdict (\w+)">\1</span> (\w+): ', top)
    assert {name: verdict for verdict, name in told} == {
        name: row["claim's verdict"] for name, row in rows.items()
    }


def test_a_claim_without_runs_is_called_so_everywhere(study: Path) -> None:
    # The study has pair high alone: figure 7 is of pair lowest.
    line = verdict(study, "H7d")
    assert line.startswith("| H7d | no runs | undetermined | ") and line.endswith(" | No runs. |")
    assert {row["claim"] for row in claims(study)} >= {claim.name for claim in ALL}
    (row,) = (row for row in claims(study) if row["claim"] == "H7d")
    assert row["claim's verdict"] == "no runs" and row["contrast"] == row["estimate"] == row["verdict"] == ""
    (cells,) = re.findall(r"<tr><td>H7d</td>.*?</tr>", page(study), re.DOTALL)
    assert ">no runs</span>" in cells and "inconclusive" not in cells


def test_grades_stand_beside_verdicts_everywhere(study: Path) -> None:
    rows, text = claims(study), page(study)
    graded = {row["claim"]: row["grade"] for row in rows}
    assert {name for name, grade in graded.items() if grade} == {claim.name for claim in ALL}
    assert all(not row["part"] for row in rows if row["grade"] == "" or not row["contrast"])
    # Every contrast of a claim that is graded shows something; this study has pair high whole.
    assert {row["part"] for row in rows if row["claim"] == "H5f"} <= {*Part}
    counted = ", ".join(f"{[graded[c.name] for c in ALL].count(grade)} {grade}" for grade in Grade)
    summary = f"Grades: {counted}."
    assert f"<p>{summary}</p>" in text and summary in (study / "report/verdicts.md").read_text()
    for name in ("C1", "H5f", "H7d"):
        assert verdict(study, name).split(" | ")[2] == graded[name]
    (cells,) = re.findall(r"<tr><td>H5f</td>.*?</tr>", text, re.DOTALL)
    assert f'<span class="grade">{graded["H5f"]}</span>' in cells
    # Ours are not graded.
    (cells,) = re.findall(r"<tr><td>E1</td>.*?</tr>", text, re.DOTALL)
    assert "grade" not in cells and [*rows[0]][-2:] == ["grade", "part"]


def test_a_claim_says_how_many_of_its_contrasts_lean_its_way(study: Path) -> None:
    values = [float(row["estimate"]) for row in claims(study) if row["claim"] == "H5f"]
    leaning = sum(value > 0 for value in values)
    assert len(values) == 9 and f"; {leaning} estimated as claimed ({min(values):+.3f} to " in verdict(
        study, "H5f"
    )


def test_what_an_earlier_study_said_stands_beside(odd: Odd) -> None:
    lines = (odd.folder / "report/verdicts.md").read_text().splitlines()

    def claims_with(words: str) -> list[str]:
        return [row.split(" | ")[0] for row in lines if words in row]

    assert claims_with("An earlier study, by its own rules: contradicted.") == ["| H5a"]
    assert claims_with('rules, of "less / &lt;b>": supported.') == ["| H5b"]


@pytest.mark.parametrize("text", ["a,b\n1,2\n", "claim,claim's verdict,sentence\nH5a,<b>,x\n", "\x00\n"])
def test_earlier_verdicts_that_cannot_be_read_are_refused(
    text: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    earlier = tmp_path / "earlier.csv"
    earlier.write_text(text)
    with pytest.raises(SystemExit):
        main([str(tmp_path)])
    told = capsys.readouterr().err
    assert told.startswith(f"ship_trl: folder: {earlier} ") and told.count("\n") == 1
    assert list(tmp_path.iterdir()) == [earlier]


def finding(value: float, reach: float = 0.05, **changes: object) -> Finding:
    estimate = Estimate(value, value - reach, value + reach)
    made = Finding("a", "area", estimate, 0.01, 0.99, 15, margin=0.03)
    return replace(made, **changes)  # type: ignore[arg-type]


def test_each_contrast_has_a_bar_on_the_scale_of_its_unit(study: Path) -> None:
    rows = [row for row in claims(study) if row["contrast"]]
    bars = re.findall(r'<svg class="bar bar-(\w+)"', page(study))
    assert sorted(bars) == sorted(row["verdict"] for row in rows)
    parts = [finding(0.1), finding(1.5, metric="spread"), finding(0.9, metric="start")]
    answers = [Answer(Hypothesis("H1", "5", "", []), parts)]
    ((title, _, scales),) = families(answers)
    assert title == "Figure 5" and set(scales) == {"difference", "spread", "start"}
    assert scales["spread"].high > 1.5 > scales["difference"].high


def test_a_wide_interval_leaves_room_to_see_the_others() -> None:
    scale = scale_of([finding(0.1, reach=9.0), finding(0.05)])
    assert -0.3 < scale.low < -0.2 and 0.2 < scale.high < 0.3
    assert scale.percent(-9) == 0 and scale.percent(9) == 100 and 40 < scale.percent(0) < 60
    scale = scale_of([finding(0.4, reach=0.1)])
    assert scale.low < 0 < 0.5 < scale.high < 0.6
    for endless in (Estimate(0.1, -np.inf, np.inf), Estimate(0.0, 0.0, 0.0)):
        scale = scale_of([finding(0.1, estimate=endless)])
        assert -1 < scale.low < 0 < scale.high < 1
    assert Estimate(0.1, -np.inf, np.inf).interval() == "unbounded"


def test_of_open_claims_it_is_said_how_many_seeds_they_want(study: Path) -> None:
    rows = {row["claim"]: row for row in claims(study)}
    wanted = {name: row["seeds wanted"] for name, row in rows.items() if row["seeds wanted"]}
    assert wanted and not any(rows[name]["decided after seeds"] for name in wanted)
    for line in (study / "report/verdicts.md").read_text().splitlines()[6:]:
        name = line.split(" | ")[0].removeprefix("| ")
        assert (f" {wanted.get(name)} seeds would tell" in line) is (name in wanted)


def test_of_each_look_it_is_said_what_it_could_see(study: Path) -> None:
    text = " ".join(page(study).split())
    # Without a plan five seeds are all, and are looked at once. Were the error known, 2.8 would be seen.
    seen = re.search(
        r"after 5 seeds \(one-sided level 0.02500, which detects a difference of ([\d.]+) standard", text
    )
    assert (
        seen
        and float(seen[1]) == pytest.approx(min_detectable_effect(5, 0.025), abs=0.05)
        and float(seen[1]) > 5
    )


def test_a_claim_open_by_the_adjustment_alone_says_what_could_be_seen() -> None:
    made = make_study({("pairs", "high", "FE1"): 0.75, ("pairs", "high", "FE2"): 0.7}, sd=0.06)
    family = [Hypothesis("A", "5", "", [beats("high", "FE1", "FE2")])]
    (one,) = judge(made, family, 15, 0.025)
    # As many other claims as its p can just not bear.
    family += [
        Hypothesis(f"B{k}", "5", "", [beats("high", "FE2", "FE1")]) for k in range(int(0.025 / one.p) + 1)
    ]
    found, *_ = judge(made, family, 15, 0.025)
    assert found.word == "inconclusive" and found.findings[0].verdict is Verdict.supported
    assert "Could see differences from" in in_a_sentence(found)


def test_runs_that_were_not_computed_alike_are_counted(odd: Odd) -> None:
    text = odd.page()
    assert re.search(r"Not computed alike, precision: bfloat16 \(1\), float32 \(\d+\)\.", text)
    assert "alike, device" not in text
    assert re.search(r"computed with .*device: cpu \(\d+\); precision: bfloat16 \(1\), float32", text)


def test_an_untrusted_study_puts_no_markup_into_the_page(odd: Odd) -> None:
    read = Page()
    read.feed(odd.page())
    assert "&lt;img src=x" in odd.page() and not any(place == "x" for place in read.fetched)
