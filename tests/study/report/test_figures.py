"""A report's figures can be read where they are shown: letters of a size, none upon others."""

from collections.abc import Callable
from itertools import combinations
from typing import Any

import matplotlib
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.text import Text

from ship_trl.study.report.style import REPORT, WIDTH
from ship_trl.study.report.write import drawings
from ship_trl.study.study import Study, read_study
from tests.study.synthetic import make_study, write_planned

# CSS pixels of a figure where it is shown smallest: the least width to which a page shrinks it.
SHOWN = 62 * 16


@pytest.fixture(scope="module")
def study(tmp_path_factory: pytest.TempPathFactory) -> Study:
    """Pair high, the new case with all sources, and the controls of them."""
    folder = tmp_path_factory.mktemp("planned")
    write_planned(folder, 5, 60, "pairs=[high]")
    return read_study(folder)


@pytest.fixture(scope="module")
def figures(study: Study) -> dict[str, tuple[Figure, list[Text]]]:
    """All figures by name, with the words that were drawn: axes hide numbers beyond their ends."""
    found, words = {}, []

    def note(text: Text, *arguments: Any, draw: Callable[..., Any] = Text.draw) -> None:
        if text.get_visible() and text.get_text().strip():
            words.append(text)
        draw(text, *arguments)

    with pytest.MonkeyPatch.context() as patch, matplotlib.rc_context(REPORT):
        patch.setattr(Text, "draw", note)
        for name, (_, draw_figure) in drawings(study).items():
            if figure := draw_figure():
                words.clear()
                FigureCanvasAgg(figure).draw()
                found[name] = figure, words[:]
    return found


@pytest.mark.long
def test_a_whole_study_has_all_figures(figures: dict[str, tuple[Figure, list[Text]]]) -> None:
    pairs, *others = figures
    assert pairs == "pair_high"
    assert others == ["reuse", "differences", "times", "gains", "gains_greedy", "gains_forest"]


@pytest.mark.long
def test_no_letter_is_smaller_than_seven_points_where_it_is_shown(
    figures: dict[str, tuple[Figure, list[Text]]],
) -> None:
    for name, (figure, words) in figures.items():
        assert figure.get_size_inches()[0] == WIDTH and words
        for text in words:
            assert float(text.get_fontsize()) * SHOWN / (96 * WIDTH) >= 7, f"{name}, {text.get_text()}"


@pytest.mark.long
def test_no_word_leaves_the_figure_or_lies_upon_another(
    figures: dict[str, tuple[Figure, list[Text]]],
) -> None:
    for name, (figure, words) in figures.items():
        whole = figure.bbox
        boxes = [(text.get_text(), text.get_window_extent()) for text in words]
        for text, box in boxes:
            inside = whole.x0 - 1 <= box.x0 and box.x1 <= whole.x1 + 1
            assert inside and whole.y0 - 1 <= box.y0 and box.y1 <= whole.y1 + 1, f"{name}: {text}"
        # Letters do not fill their boxes: a pixel or two may be of both.
        slack = 0.03 * figure.dpi
        for (text, first), (other, second) in combinations(boxes, 2):
            across = min(first.x1, second.x1) - max(first.x0, second.x0)
            down = min(first.y1, second.y1) - max(first.y0, second.y0)
            assert across < slack or down < slack, f"{name}: {text!r} and {other!r}"


def test_nothing_is_drawn_of_no_runs() -> None:
    study = make_study({("controls", "self", "FE1"): 0.5}, seeds=2)
    assert [name for name, (_, draw) in drawings(study).items() if draw() is not None] == []
