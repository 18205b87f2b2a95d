"""A report's figures can be read at both widths: letters of a size, none upon others; and are written."""

from collections.abc import Callable
from dataclasses import dataclass
from itertools import combinations
from typing import Any

import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.text import Text

from ship_trl.study.report.style import DPI, NARROW, WIDE
from ship_trl.study.report.write import drawings
from ship_trl.study.study import Study, read_study
from tests.study.synthetic import make_study, write_planned

# CSS pixels of a figure where it is shown smallest: a page of 64 rem, and a screen of 380, less the edges.
SHOWN = {WIDE: 64 * 16 - 32, NARROW: 380 - 32}


@pytest.fixture(scope="module")
def study(tmp_path_factory: pytest.TempPathFactory) -> Study:
    """Pair high, the new case with all sources, and the controls of them."""
    folder = tmp_path_factory.mktemp("planned")
    write_planned(folder, 5, 60, "pairs=[high]")
    return read_study(folder)


@dataclass(frozen=True)
class Shown:
    """A figure of a width, with the words that were drawn: numbers of axes beyond their ends are none."""

    name: str
    width: float
    figure: Figure
    words: list[Text]


@pytest.fixture(scope="module")
def figures(study: Study) -> list[Shown]:
    """All figures of the study at both widths."""
    found, words = [], []

    def note(text: Text, *arguments: Any, draw: Callable[..., Any] = Text.draw) -> None:
        if text.get_visible() and text.get_text().strip():
            words.append(text)
        draw(text, *arguments)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Text, "draw", note)
        for name, (_, draw_figure) in drawings(study).items():
            for width in (WIDE, NARROW):
                figure = draw_figure(width)
                if figure is not None:
                    words.clear()
                    FigureCanvasAgg(figure).draw()
                    found.append(Shown(name, width, figure, words[:]))
    return found


@pytest.mark.long
def test_a_whole_study_has_all_figures(figures: list[Shown]) -> None:
    for width in (WIDE, NARROW):
        names = {one.name for one in figures if one.width == width}
        assert names == {
            "pair_high",
            "reuse",
            "differences",
            "times",
            "gains",
            "gains_greedy",
            "gains_forest",
        }


@pytest.mark.long
def test_no_letter_is_smaller_than_seven_points_where_it_is_shown(figures: list[Shown]) -> None:
    for one in figures:
        assert one.figure.get_size_inches()[0] == one.width and one.words
        shrunk = SHOWN[one.width] / (96 * one.width)
        for text in one.words:
            assert float(text.get_fontsize()) * shrunk >= 7, f"{one.name}, {text.get_text()}"


@pytest.mark.long
def test_no_word_leaves_the_figure_or_lies_upon_another(figures: list[Shown]) -> None:
    for one in figures:
        whole = one.figure.bbox
        boxes = [(text.get_text(), text.get_window_extent()) for text in one.words]
        for text, box in boxes:
            inside = whole.x0 - 1 <= box.x0 and box.x1 <= whole.x1 + 1
            assert inside and whole.y0 - 1 <= box.y0 and box.y1 <= whole.y1 + 1, f"{one.name}: {text}"
        # Letters do not fill their boxes: a pixel or two may be of both.
        slack = 0.03 * DPI[one.width]
        for (text, first), (other, second) in combinations(boxes, 2):
            across = min(first.x1, second.x1) - max(first.x0, second.x0)
            down = min(first.y1, second.y1) - max(first.y0, second.y0)
            assert across < slack or down < slack, f"{one.name}, {one.width}: {text!r} and {other!r}"


def test_nothing_is_drawn_of_no_runs() -> None:
    study = make_study({("controls", "self", "FE1"): 0.5}, seeds=2)
    assert [name for name, (_, draw) in drawings(study).items() if draw(WIDE) is not None] == []
