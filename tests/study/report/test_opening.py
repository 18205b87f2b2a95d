"""What a report opens with: the study's own question, what each arm reached, how far it is from scratch."""

import csv
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from ship_trl.study.manifest import Plan
from ship_trl.study.report import opening, write
from ship_trl.study.report.gains import draw_effects
from tests.command import report as main
from tests.study.report.seen import across
from tests.study.synthetic import learning, returns_of, study_of, write_run


def test_a_difference_is_measured_within_a_seed_in_raw_returns() -> None:
    scratch = np.linspace(0.2, 0.6, 6)
    scratch_arm, arm = opening.measure_arms(study_of(FT3=scratch + 0.1, scratch=scratch))
    assert (scratch_arm.arm, arm.arm, scratch_arm.differences) == ("scratch", "FT3", {})
    found = arm.differences[opening.RETURN]
    gained = float(returns_of(np.array(0.1)) - returns_of(np.array(0.0)))
    # Seeds differ widely, the difference within each does not.
    assert (found.value, found.low, found.high) == pytest.approx([gained] * 3, abs=1e-6)
    assert arm.headline.startswith(f"FT3 against scratch, case 2, 6 seeds: greedy return +{gained:.1f} (")
    assert arm.headline.endswith("; better") and arm.row["greedy return above scratch"] == pytest.approx(
        gained
    )


@pytest.mark.parametrize(
    ("by", "seeds", "said"),
    [(-0.1, 6, "worse"), (0.1, 4, "too few seeds to tell"), (0.1, 1, "too few seeds to tell")],
)
def test_the_headline_says_what_the_interval_shows(by: float, seeds: int, said: str) -> None:
    scratch = np.linspace(0.3, 0.6, seeds)
    *_, arm = opening.measure_arms(study_of(scratch=scratch, FT3=scratch + by))
    assert arm.headline.endswith(f"; {said}")
    noise = np.array([0.2, -0.2, 0.1, -0.1, 0.05, -0.05])
    *_, arm = opening.measure_arms(study_of(scratch=np.full(6, 0.5), FT3=0.5 + noise))
    assert arm.headline.endswith("; no difference shown")


def test_the_title_is_the_question_or_names_what_is_compared() -> None:
    study = study_of(scratch=np.full(2, 0.3), FT3=np.full(2, 0.4), FE3=np.full(2, 0.4))
    assert opening.title_of(study) == "FE3, FT3 against scratch: case 2"
    asked = replace(study, plan=Plan({}, {}, [], question="Does it help?"))
    assert opening.title_of(asked) == "Does it help?"


def test_right_is_better_and_an_arm_has_its_colour() -> None:
    scratch = np.linspace(0.2, 0.6, 6)
    figure = draw_effects(study_of(scratch=scratch, FE1=scratch - 0.2, FT3=scratch + 0.1))
    assert figure is not None
    (axis,) = figure.axes
    assert [label.get_text() for label in axis.get_yticklabels()] == ["FE1", "FT3"]
    worse, better = (float(across(line)[0]) for line in axis.lines if line.get_marker() == "o")
    assert worse < 0 < better and "better \N{RIGHTWARDS ARROW}" in axis.get_xlabel()
    colours = {line.get_color() for line in axis.lines if line.get_marker() == "o"}
    assert len(colours) == 2 and axis.get_xlim()[0] < worse and better < axis.get_xlim()[1]
    assert draw_effects(study_of(scratch=scratch)) is None


def write_own(folder: Path, **changes: Any) -> None:
    rng = np.random.default_rng(0)
    for arm, end in (("scratch", 0.5), ("FT3", 0.8)):
        for seed in range(5):
            scores = learning(rng, 60, end, noise=0.02)
            write_run(folder / "pairs", scores, pair="harbour", arm=arm, seed=seed, target="mine", **changes)


def test_a_study_of_ones_own_opens_with_its_question_and_no_claims(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(write, "draw_all", lambda *_: [])
    write_own(tmp_path)
    jobs = [
        {"name": "", "stage": 0, "part": "pairs", "label": "harbour", "arm": arm, "seed": seed}
        for arm in ("scratch", "FT3")
        for seed in range(6)
    ]
    plan = Plan(
        {"learn": {"lr": 0.5}}, {"mine": "ab12"}, [], question="Help for <us>?", words=["pairs=[harbour]"]
    )
    text = plan.to_json().replace('"jobs": []', f'"jobs": {jobs}'.replace("'", '"'))
    (tmp_path / "study.json").write_text(text)
    main([str(tmp_path)])
    page = (tmp_path / "report/index.html").read_text()
    body = page.partition("</style>")[2]
    assert "<h1>Help for &lt;us&gt;?</h1>" in body and "claim" not in body and "verdict" not in body
    headline = re.search(r"<li>(FT3 against scratch, case 1 to case mine, 5 seeds: .*; better)</li>", body)
    assert headline and f"{headline[1]}\n" in capsys.readouterr().out
    # Not all has run, and that stands at the top; what was run, and by which command, at the end.
    assert body.index("Missing: 2 planned runs") < body.index("Outcomes by arm")
    again = "python -m ship_trl study run &#39;pairs=[harbour]&#39; output=outputs/again</pre>"
    assert again in body
    # In place of an empty figure.
    assert "No run&#39;s moving score has reached 0.65" in body.replace("'", "&#39;")
    assert "<th>learn.lr</th><td>0.5</td>" in body and "mine (ab12)" in body
    with (tmp_path / "report/effects.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert [row["arm"] for row in rows] == ["scratch", "FT3"]
    assert float(rows[1]["greedy return above scratch low"]) > 0


def test_a_study_of_drawn_starts_has_returns_and_no_scores(tmp_path: Path) -> None:
    write_own(tmp_path, best_known_return=None)
    main([str(tmp_path)])
    with (tmp_path / "report/arms.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert {row["area"] for row in rows} == {""} and {row["reached"] for row in rows} == {""}
    assert all(float(row["success"]) >= 0 for row in rows)
    pictures = {path.stem for path in (tmp_path / "report").glob("*.png")}
    assert pictures == {"effects", "pair_harbour"}
    assert "FT3 against scratch" in (tmp_path / "report/index.html").read_text()
