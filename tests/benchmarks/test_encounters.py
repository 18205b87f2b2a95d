"""The table of encounters: policies by suites, in a page and a CSV file."""

import csv
from pathlib import Path

import pytest

from benchmarks import __main__ as command
from benchmarks.encounters import BEGIN, COLUMNS, END
from tests.command import ROOT


def run(folder: Path, *words: str) -> str:
    page = folder / "page.md"
    files = ("--markdown", str(page), "--csv", str(folder / "all.csv"))
    command.main(["encounters", *words, *files])
    return page.read_text()


def tables(page: str) -> dict[str, list[list[str]]]:
    """Return the rows of each suite's table."""
    found = {}
    for part in page.split("### ")[1:]:
        name, _, rest = part.partition("\n")
        lines = [line for line in rest.splitlines() if line.startswith("|")][2:]
        found[name] = [[cell.strip() for cell in line.strip("|").split("|")] for line in lines]
    return found


def test_a_table_of_each_suite(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    page = run(tmp_path, "keep_course", "best_known", "target=paper,traffic", "--episodes", "20")
    found = tables(page)
    assert [row[0] for row in found["paper"]] == ["keep_course", "best_known"]
    assert found["paper"][1][COLUMNS.index("success")] == "100% (65 to 100)"
    # best_known has no plan of random scenes, which also have a table by class.
    assert "best_known has no plan of a drawn start" in capsys.readouterr().err
    whole, head, _, classes = found["traffic"]
    assert whole[0] == classes[0] == "keep_course" and whole[COLUMNS.index("episodes")] == "20"
    assert head[0] == "success by class" and classes[head.index("none")] == "100%"
    assert {"0%"} >= {classes[head.index(name)] for name in head[1:] if name != "none"}
    with (tmp_path / "all.csv").open() as file:
        assert len(list(csv.DictReader(file))) == 2 * 7 + 20


def test_a_page_keeps_its_text_around_the_tables(tmp_path: Path) -> None:
    text = (ROOT / "docs/encounters.md").read_text()
    before, _, rest = text.partition(BEGIN)
    (tmp_path / "page.md").write_text(text)
    for _ in range(2):
        page = run(tmp_path, "keep_course", "target=paper")
        assert page.startswith(before + BEGIN) and page.endswith(END + rest.partition(END)[2])
        assert page.count("### paper") == page.count(END) == 1


def test_a_page_is_written_only_where_one_is_named(tmp_path: Path) -> None:
    (tmp_path / "docs").mkdir()
    page = tmp_path / "docs/encounters.md"
    page.write_text("of all policies")
    command.main(["encounters", "keep_course", "target=2"])
    assert page.read_text() == "of all policies" and (tmp_path / "outputs/encounters.csv").is_file()


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ("vo target=nowhere", "target: no case or suite nowhere"),
        ("nobody target=paper", "policy: no nobody; allowed: random, keep_course"),
        ("vo target=paper --episodes 0", "--episodes: must be at least 1"),
        ("vo target=paper --head-on 91", "--head-on: must be above 0 and at most 90, got 91"),
        ("vo target=paper --markdown no/x.md", "--markdown: no folder"),
        ("vo target=paper --markdown x.txt", "--markdown: must be a name that ends with .md"),
    ],
)
def test_wrong_input_is_one_line(words: str, said: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        command.main(["encounters", *words.split()])
    error = capsys.readouterr().err
    assert ended.value.code == 1 and said in error and error.count("\n") == 1
