"""Tables: parts that fit the line, and cells that stay whole."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from ship_trl.run.console import GAP, MIN_WIDTH, show, split

WORDS = st.text(st.characters(codec="ascii", categories=("L", "N", "P")), min_size=1, max_size=12)
CELLS = st.lists(WORDS, min_size=1, max_size=4).map(" ".join)


COLUMN = st.lists(CELLS, min_size=3, max_size=3)


@given(st.lists(COLUMN, min_size=1, max_size=12), st.integers(MIN_WIDTH, 200))
def test_parts_fit_and_hold_each_column_once(columns: list[list[str]], limit: int) -> None:
    whole = [max(map(len, column)) for column in columns]
    parts = list(split(columns, whole, limit, names=1))
    assert [k for part, _ in parts for k in part[1:]] == list(range(1, len(columns)))
    for part, widths in parts:
        assert part[0] == 0 and sum(widths) + GAP * (len(widths) - 1) <= limit
        for k, width in zip(part[1:], widths[1:], strict=True):
            # A cell is narrower than its column unless it would not fit a part of its own.
            assert width >= max(map(len, columns[k][1:])) or width == limit - widths[0] - GAP


def test_a_file_has_lines_of_any_length(capsys: pytest.CaptureFixture[str]) -> None:
    many = " ".join(f"{number}.25" for number in range(500))
    show(("run", "returns"), [("scratch", many)], title="Runs")
    assert f"scratch  {many}\n" in capsys.readouterr().out


def test_columns_are_chosen_by_their_headings(capsys: pytest.CaptureFixture[str]) -> None:
    show(("run", "seed", "return"), [("scratch", "3", "43.3")], True, "Runs", shown=("return", "run"))
    assert capsys.readouterr().out == "Runs\n\n| run | return |\n| --- | --- |\n| scratch | 43.3 |\n\n"
