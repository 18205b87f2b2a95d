"""The simulation of grades: p-values as those of the package, and grades that follow the truth."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from ship_trl.study.statistics import Estimate, Sample, estimate_mean
from studies.paper import rates
from studies.paper.contrasts import Claimed, Spread, add_p_values, beats
from studies.paper.judge import Claim, Finding, Grade, measure_parts
from tests.study.synthetic import make_study, write_study

MARGIN, SHARE = 0.1, 0.2


def contrast(
    what: str, values: Sample, margin: float | None = None, claimed: Claimed = Claimed.above
) -> Finding:
    found = replace(estimate_mean(values), what=what, differences=tuple(values.tolist()))
    return Finding(add_p_values(found, claimed, margin), claimed)


def findings(count: int, claimed: Claimed = Claimed.above, seeds: int = 15) -> list[Finding]:
    rng = np.random.default_rng(0)
    return [contrast(f"{k}", rng.normal(0.3, 0.05, seeds), MARGIN, claimed) for k in range(count)]


@pytest.mark.parametrize("claimed", [*Claimed])
def test_differences_are_moved_to_a_truth_of_as_many_margins(claimed: Claimed) -> None:
    (one,) = findings(1, claimed, 5)
    drawn = rates.move(one, 2.0, np.array([3, 3, 0, 1, 4])).found
    truth = 2.0 * MARGIN if claimed is Claimed.above else 0.0
    shifted = np.array(one.found.differences)[[3, 3, 0, 1, 4]] - one.found.value + truth
    assert drawn.differences == pytest.approx(shifted)
    expected = contrast("", np.array(drawn.differences), MARGIN, claimed).found
    assert (drawn.p, drawn.against) == (expected.p, expected.against)


def test_grades_follow_the_truth() -> None:
    claims = [findings(3), findings(2), findings(1)]
    counts = rates.moved(claims, SHARE, 20)
    nothing, margin, gain = counts.values()
    assert [*counts] == ["moved to nothing", "moved to the margin", "moved to what could be gained"]
    assert nothing[Grade.size_excluded] + nothing[Grade.undetermined] > 2.5
    assert gain[Grade.supported] > 2.9 and margin[Grade.contradicted] == 0
    assert all(sum(one.values()) == pytest.approx(3) for one in counts.values())


def test_parts_without_a_known_size_stay_at_zero() -> None:
    spread = Finding(Estimate(0.5, 0.1, 0.9, 15, "a", "spread", 0.0, 1.0))
    (unknown,) = findings(1)
    unknown = contrast("b", np.array(unknown.found.differences))
    for one in (spread, unknown):
        gain = rates.moved([[*findings(1), one]], SHARE, 20)["moved to what could be gained"]
        assert gain[Grade.leaning_for] > 0.8
    (bounded,) = findings(1, Claimed.no_more)
    assert all(one[Grade.supported] > 0.8 for one in rates.moved([[bounded]], SHARE, 20).values())
    assert rates.moved([[]], SHARE, 3)["moved to nothing"][Grade.undetermined] == 1


def test_shuffled_labels_show_nothing_where_the_study_shows_much() -> None:
    ends = {("pairs", "high", arm): 0.4 + 0.1 * k for k, arm in enumerate(("scratch", "FE1", "FE2", "FE3"))}
    study = make_study(ends)
    tests = [beats("high", "FE3", "scratch"), beats("high", "FE2", "FE1")]
    claims = [Claim("A", "5", "", tests), Claim("B", "5", "", [Spread("high", "FE1", "FE2")])]
    (parts, _) = measure_parts(study, claims).values()
    assert max(one.found.p for one in parts) < 0.001
    counts = rates.shuffled(study, 10, claims)
    assert counts[Grade.size_excluded] + counts[Grade.undetermined] > 1.6
    assert counts == rates.shuffled(study, 10, claims)


def test_shuffling_keeps_target_and_seed_of_each_run() -> None:
    study = make_study({("pairs", "high", arm): 0.5 for arm in ("scratch", "FE1", "FE2")}, seeds=4)
    made = rates.shuffle(study, np.random.default_rng(0))
    assert made.records.keys() == study.records.keys()
    assert all(record.seed == key[3] for key, record in made.records.items())
    assert sorted(map(id, made.records.values())) == sorted(map(id, study.records.values()))
    assert any(record.arm != key[2] for key, record in made.records.items())


def test_from_arguments_to_table(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write_study(tmp_path, seeds=5)
    rates.main([str(tmp_path), "--draws", "2", "--markdown"])
    said, _, table = capsys.readouterr().out.partition("\n\n")
    assert said.startswith("Mean number of the 31 claims with each grade, 2 draws a row.")
    head, _, *rows = table.strip().splitlines()
    assert head == f"| data | {' | '.join(Grade)} |" and len(rows) == 5
    for row in rows:
        assert sum(float(cell) for cell in row.strip("| ").split(" | ")[1:]) == pytest.approx(31, abs=0.05)


def test_wrong_input_is_one_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for words, said in (([str(tmp_path)], "no finished run"), (["--draws", "0"], "--draws: must be")):
        with pytest.raises(SystemExit):
            rates.main(words)
        error = capsys.readouterr().err
        assert said in error and error.count("\n") == 1
