"""The command that makes the report: whole, with what is broken named, and alike each time."""

import base64
import csv
import html.parser
import json
import os
import re
import resource
import shutil
import struct
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from ship_trl.report import main
from ship_trl.study.analysis.contrasts import Verdict
from ship_trl.study.analysis.power import seen_effect
from ship_trl.study.claims.kinds import Hypothesis, beats
from ship_trl.study.claims.verdicts import ALL, judge
from ship_trl.study.report.page import in_a_sentence
from tests.study.synthetic import learning, make_study, write_planned, write_run
from tests.test_cli import ROOT, files

ARMS = ("scratch", "FE1", "FE2", "FE3", "FE4", "FT1", "FT2", "FT3", "FT4", "FTW")


def write_study(folder: Path, seeds: int, episodes: int = 60, pairs: tuple[str, ...] = ("high",)) -> None:
    rng = np.random.default_rng(0)
    for pair in pairs:
        for k, arm in enumerate(ARMS):
            for seed in range(seeds):
                scores = learning(rng, episodes, 0.5 + 0.04 * k)
                write_run(folder / "pairs", scores, pair=pair, arm=arm, seed=seed)


@pytest.fixture(scope="module")
def study(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("study")
    write_study(folder, seeds=5)
    main([str(folder)])
    return folder


class Page(html.parser.HTMLParser):
    """Tags that were opened and not closed, and what the page would fetch."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.fetched: list[str] = []

    def handle_starttag(self, tag: str, attributes: list[tuple[str, str | None]]) -> None:
        if tag not in ("meta", "link", "img", "source"):
            self.open.append(tag)
        self.fetched += [v or "" for k, v in attributes if k in ("src", "srcset", "href")]

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag


def test_the_page_is_whole_and_needs_nothing_else(study: Path) -> None:
    page, text = Page(), (study / "report/index.html").read_text()
    page.feed(text)
    assert page.open == [] and all(link.startswith("data:") for link in page.fetched)
    assert "50 runs of the profile quick, 60 episodes each, 5 seeds" in text
    assert text.count('<section class="card">') == 5 and 'class="verdict supported"' in text


def test_tables_and_figures_lie_beside_it(study: Path) -> None:
    with (study / "report/runs.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 50 and 0 < float(rows[0]["area"]) < 1
    with (study / "report/arms.csv").open(newline="") as file:
        arms = {row["arm"]: row for row in csv.DictReader(file)}
    assert (
        float(arms["FTW"]["area"]) > float(arms["scratch"]["area"])
        and arms["scratch"]["transfer ratio"] == ""
    )
    low, value, high = (float(arms["FTW"][f"transfer ratio{end}"]) for end in (" low", "", " high"))
    assert 0 < low < value < high
    for name in ("pair_high", "differences", "times", "gains", "forest_5", "forest_conclusions"):
        for ending in ("png", "pdf"):
            assert (study / f"report/{name}.{ending}").stat().st_size > 3_000


def test_figures_of_an_earlier_report_go_and_other_files_stay(tmp_path: Path) -> None:
    write_study(tmp_path, seeds=2)
    output = tmp_path / "report"
    output.mkdir()
    earlier = ["pair_low.png", "pair_low.pdf", "reuse.png", "forest_3.pdf"]
    for name in [*earlier, "mine.png", "pair_low.txt"]:
        (output / name).touch()
    main([str(tmp_path)])
    left = {path.name for path in output.iterdir()}
    assert not left & set(earlier) and {"mine.png", "pair_low.txt", "pair_high.png", "times.pdf"} <= left


def test_each_figure_has_a_form_for_telephones(study: Path) -> None:
    text = (study / "report/index.html").read_text()
    found = re.findall(
        r'<picture>\n<source media="\(max-width: 64rem\)" srcset="data:image/png;base64,([^"]*)">\n'
        r'<img src="data:image/png;base64,([^"]*)"',
        text,
    )
    assert len(found) == text.count("<img ") >= 6

    def size(data: str) -> tuple[int, int]:
        # In a PNG width and height come after its mark and the head of its first part.
        return struct.unpack(">II", base64.b64decode(data)[16:24])

    for narrow, wide in found:
        assert size(narrow)[0] < 700 < 1200 < size(wide)[0]


def test_nothing_of_the_page_is_wider_than_a_telephone_but_what_moves_in_itself(study: Path) -> None:
    text = (study / "report/index.html").read_text()
    style = text[text.index("<style>") : text.index("</style>")]
    # In rem of 16 pixels; a page of 380 leaves 348.
    widths = [float(width) * 16 for width in re.findall(r"[{;(\s](?:min-)?width: ([\d.]+)rem", style)]
    assert widths and max(widths) <= 348
    assert len(re.findall(r"<table", text)) == len(re.findall(r'<div class="wide"><table', text))
    assert ".wide { overflow-x: auto }" in style


def test_verdicts_are_a_markdown_table(study: Path) -> None:
    lines = (study / "report/verdicts.md").read_text().splitlines()
    assert len(lines) == 2 + len(ALL) and all(line.count(" | ") == 3 for line in lines)
    (line,) = (line for line in lines if line.startswith("| H5h | "))
    assert "FT2 &lt; FT3 &lt; FT4 &lt; FTW" in line


def test_a_claim_without_runs_is_called_so_everywhere(study: Path) -> None:
    # The study has pair high alone: figure 7 is of pair lowest.
    (line,) = (
        line for line in (study / "report/verdicts.md").read_text().splitlines() if line.startswith("| H7d ")
    )
    assert line.startswith("| H7d | no runs | ") and line.endswith(" | No runs. |")
    with (study / "report/claims.csv").open(newline="") as file:
        claims = list(csv.DictReader(file))
    assert {row["claim"] for row in claims} >= {claim.name for claim in ALL}
    (row,) = (row for row in claims if row["claim"] == "H7d")
    assert row["claim's verdict"] == "no runs" and row["contrast"] == row["estimate"] == row["verdict"] == ""
    page = (study / "report/index.html").read_text()
    (cells,) = re.findall(r"<tr><td>H7d</td>.*?</tr>", page, re.DOTALL)
    assert ">no runs</span>" in cells and "inconclusive" not in cells


def test_a_claim_says_how_many_of_its_contrasts_lean_its_way(study: Path) -> None:
    with (study / "report/claims.csv").open(newline="") as file:
        values = [float(row["estimate"]) for row in csv.DictReader(file) if row["claim"] == "H5f"]
    (line,) = (
        line for line in (study / "report/verdicts.md").read_text().splitlines() if line.startswith("| H5f ")
    )
    leaning = sum(value > 0 for value in values)
    assert len(values) == 9 and f"; {leaning} estimated as claimed ({min(values):+.3f} to " in line


def test_the_same_study_gives_the_same_bytes(study: Path, tmp_path: Path) -> None:
    main([str(study), "--output", str(tmp_path)])
    assert files(tmp_path) == files(study / "report")


def test_what_an_earlier_study_said_stands_beside(
    study: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    earlier = tmp_path / "claims.csv"
    with (study / "report/claims.csv").open(newline="") as file:
        sentence = next(row["sentence"] for row in csv.DictReader(file) if row["claim"] == "H5a")
    rows = (("H5a", "contradicted", sentence), ("H5b", "supported", "less | <b>"), ("OLD", "supported", ""))
    with earlier.open("w", newline="") as file:
        csv.writer(file).writerows([("claim", "claim's verdict", "sentence"), *rows])
    main([str(study), "--output", str(tmp_path / "page"), "--earlier", str(earlier)])
    lines = (tmp_path / "page/verdicts.md").read_text().splitlines()
    said = [
        row.split(" | ")[0] for row in lines if "An earlier study, by its own rules: contradicted." in row
    ]
    assert said == ["| H5a"] and "An earlier study" not in (study / "report/verdicts.md").read_text()
    said = [row.split(" | ")[0] for row in lines if 'rules, of "less / &lt;b>": supported.' in row]
    assert said == ["| H5b"]
    for text in ("a,b\n1,2\n", "claim,claim's verdict,sentence\nH5a,<b>perhaps</b>,x\n", "\x00\n"):
        earlier.write_text(text)
        capsys.readouterr()
        with pytest.raises(SystemExit):
            main([str(study), "--output", str(tmp_path / "other"), "--earlier", str(earlier)])
        told = capsys.readouterr().err
        assert told.startswith(f"ship_trl: --earlier: {earlier} ") and told.count("\n") == 1
    assert not (tmp_path / "other").exists()


def test_of_open_claims_it_is_said_how_many_seeds_they_want(study: Path) -> None:
    with (study / "report/claims.csv").open(newline="") as file:
        rows = {row["claim"]: row for row in csv.DictReader(file)}
    wanted = {name: row["seeds wanted"] for name, row in rows.items() if row["seeds wanted"]}
    assert wanted and not any(rows[name]["decided after seeds"] for name in wanted)
    for line in (study / "report/verdicts.md").read_text().splitlines()[2:]:
        name = line.split(" | ")[0].removeprefix("| ")
        assert (f" {wanted.get(name)} seeds would tell" in line) is (name in wanted)


def test_of_each_look_it_is_said_what_it_could_see(study: Path) -> None:
    text = " ".join((study / "report/index.html").read_text().split())
    # Without a plan five seeds are all, and are looked at once. Were the error known, 2.8 would be seen.
    seen = re.search(
        r"after 5 seeds \(one-sided level 0.02500, which sees a difference of ([\d.]+) standard", text
    )
    assert seen and float(seen[1]) == pytest.approx(seen_effect(5, 0.025), abs=0.05) and float(seen[1]) > 5


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


def test_what_is_broken_is_named_and_the_rest_counted(
    study: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    write_study(tmp_path, seeds=2)
    place = tmp_path / "pairs/high"
    (place / "FE1/seed=0/curve.csv").write_text("episode")
    (place / "FE2/seed=1/result.json").unlink()
    (place / "FTW/seed=0/result.json").write_text("{}")
    copied = tmp_path / "pairs_old/high/FE3/seed=0"
    shutil.copytree(place / "FE3/seed=0", copied)
    planned = [
        {"part": "pairs", "label": "high", "arm": arm, "seed": seed} for arm in ARMS for seed in (0, 1, 2)
    ]
    (tmp_path / "study.json").write_text(json.dumps({"jobs": planned}))
    main([str(tmp_path)])
    said = capsys.readouterr()
    assert said.err.count("left out") == 4 and "17 runs, 4 left out" in said.out
    assert "pairs_old is no part of a study" in said.err
    text = (tmp_path / "report/index.html").read_text()
    # A third seed of each of ten arms; what is broken is named, not missing.
    assert "10 planned runs are missing" in text and text.count("<li>") == 4


def test_runs_that_were_not_computed_alike_are_counted(tmp_path: Path) -> None:
    write_study(tmp_path, seeds=2)
    for seed, precision in ((0, "bfloat16"), (1, "float32")):
        path = tmp_path / f"pairs/high/FE1/seed={seed}/result.json"
        path.write_text(json.dumps(json.loads(path.read_text()) | {"precision": precision, "device": "cpu"}))
    main([str(tmp_path)])
    text = (tmp_path / "report/index.html").read_text()
    assert re.search(r"Not computed alike, precision: bfloat16 \(1\), float32 \(\d+\)\.", text)
    assert "alike, device" not in text


@pytest.mark.parametrize("make", [False, True])
def test_nothing_to_report_is_one_line(
    make: bool, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = tmp_path / "none"
    if make:
        folder.mkdir()
    with pytest.raises(SystemExit) as caught:
        main([str(folder)])
    error = capsys.readouterr().err
    assert caught.value.code == 1 and error.startswith("ship_trl: folder: no ") and error.count("\n") == 1


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
        "import sys; from ship_trl.report import main; main([sys.argv[1]]);"
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
    study: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    before = files(study)
    with pytest.raises(SystemExit) as caught:
        main([str(study), "--output", str(study / "report/..")])
    assert caught.value.code == 1
    assert "is the study's own folder" in capsys.readouterr().err and files(study) == before


def test_a_strangers_study_puts_no_markup_into_the_page(tmp_path: Path) -> None:
    write_study(tmp_path, seeds=2)
    name = "<img src=x onerror=alert(1)>"
    (tmp_path / "pairs" / name / "scratch" / "seed=0").mkdir(parents=True)
    main([str(tmp_path)])
    page, text = Page(), (tmp_path / "report/index.html").read_text()
    page.feed(text)
    assert "&lt;img src=x" in text and not any(place == "x" for place in page.fetched)


def test_a_report_is_written_through_no_link(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    private = tmp_path / "private"
    private.mkdir()
    (private / "pair_mine.png").touch()
    (tmp_path / "study").mkdir()
    (tmp_path / "study/report").symlink_to(private)
    with pytest.raises(SystemExit):
        main([str(tmp_path / "study")])
    assert f"output: {tmp_path / 'study/report'} is a link" in capsys.readouterr().err
    assert [path.name for path in private.iterdir()] == ["pair_mine.png"]
