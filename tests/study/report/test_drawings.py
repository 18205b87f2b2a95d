"""What a report's figures show, and that they can be read: letters of a size, none upon others."""

from collections.abc import Callable
from dataclasses import dataclass
from itertools import combinations
from typing import Any

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.text import Text
from ship_trl.study.report.drawings import drawings

from ship_trl.study.analysis.study import Study, read_study
from ship_trl.study.claims.verdicts import Answer, answer, explore
from ship_trl.study.report.figures import PAGE, TELEPHONE, Form
from tests.study.synthetic import make_study, write_planned

# CSS pixels of a figure where its form is smallest: a page of 64 rem and a telephone of 380, less the edges.
SHOWN = {PAGE: 64 * 16 - 32, TELEPHONE: 380 - 32}


@pytest.fixture(scope="module")
def study(tmp_path_factory: pytest.TempPathFactory) -> Study:
    """Pair high, the new case with all sources, and the controls of them."""
    folder = tmp_path_factory.mktemp("planned")
    write_planned(folder, 5, 60, "pairs=[high]")
    return read_study(folder)


@pytest.fixture(scope="module")
def answers(study: Study) -> list[Answer]:
    return [*answer(study), *explore(study)]


@dataclass(frozen=True)
class Shown:
    """A figure of a form, with the words that were drawn: numbers of axes beyond their ends are none."""

    name: str
    form: Form
    figure: Figure
    words: list[Text]


@pytest.fixture(scope="module")
def figures(study: Study, answers: list[Answer]) -> list[Shown]:
    """All figures of the study in both forms, drawn."""
    found, words = [], []

    def note(text: Text, *arguments: Any, draw: Callable[..., Any] = Text.draw) -> None:
        if text.get_visible() and text.get_text().strip():
            words.append(text)
        draw(text, *arguments)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Text, "draw", note)
        for drawing in drawings(study, answers):
            for form in (PAGE, TELEPHONE):
                figure = drawing.draw(form)
                if figure is not None:
                    words.clear()
                    FigureCanvasAgg(figure).draw()
                    found.append(Shown(drawing.name, form, figure, words[:]))
    return found


def test_a_whole_study_has_all_figures(figures: list[Shown]) -> None:
    names = {one.name for one in figures if one.form is PAGE}
    forests = {f"forest_{name}" for name in ("4", "5", "9", "conclusions", "exploratory")}
    assert names == {"pair_high", "reuse", "differences", "times", "gains", "gains_greedy", *forests}
    assert names == {one.name for one in figures if one.form is TELEPHONE}


def test_no_letter_is_smaller_than_seven_points_where_it_is_shown(figures: list[Shown]) -> None:
    for one in figures:
        assert one.figure.get_size_inches()[0] == one.form.width and one.words
        shrunk = SHOWN[one.form] / (96 * one.form.width)
        for text in one.words:
            assert float(text.get_fontsize()) * shrunk >= 7, f"{one.name}, {text.get_text()}"


def test_no_word_leaves_the_figure_or_lies_upon_another(figures: list[Shown]) -> None:
    for one in figures:
        whole = one.figure.bbox
        boxes = [(text.get_text(), text.get_window_extent()) for text in one.words]
        for text, box in boxes:
            inside = whole.x0 - 1 <= box.x0 and box.x1 <= whole.x1 + 1
            assert inside and whole.y0 - 1 <= box.y0 and box.y1 <= whole.y1 + 1, f"{one.name}: {text}"
        # Letters do not fill their boxes: a pixel or two may be of both.
        slack = 0.03 * one.form.dpi
        for (text, first), (other, second) in combinations(boxes, 2):
            across = min(first.x1, second.x1) - max(first.x0, second.x0)
            down = min(first.y1, second.y1) - max(first.y0, second.y0)
            assert across < slack or down < slack, f"{one.name}, {one.form}: {text!r} and {other!r}"


def test_nothing_is_drawn_of_no_runs() -> None:
    study = make_study({("controls", "self", "FE1"): 0.5}, seeds=2)
    assert [drawing.name for drawing in drawings(study, []) if drawing.draw(PAGE) is not None] == []


def test_from_scratch_alone_there_are_its_curves() -> None:
    study = make_study({("pairs", "high", "scratch"): 0.5}, seeds=2)
    drawn = [drawing.name for drawing in drawings(study, []) if drawing.draw(TELEPHONE) is not None]
    assert drawn == ["pair_high"]


def test_a_figure_is_drawn_alike_each_time(study: Study, answers: list[Answer]) -> None:
    def drawn() -> dict[str, bytes]:
        made: dict[str, Callable[[Form], Figure | None]] = {d.name: d.draw for d in drawings(study, answers)}
        found = {}
        for name in ("pair_high", "differences"):
            figure = made[name](TELEPHONE)
            assert figure is not None
            canvas = FigureCanvasAgg(figure)
            canvas.draw()
            found[name] = np.asarray(canvas.buffer_rgba()).tobytes()
        return found

    assert drawn() == drawn()
