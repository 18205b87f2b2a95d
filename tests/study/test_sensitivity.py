"""Other tests than the plan's, where they must differ from it and where they must not."""

import re
from pathlib import Path

import numpy as np
import pytest
from scipy import stats

from ship_trl.study.analysis.contrasts import Claimed, contrast
from ship_trl.study.analysis.statistics import spread_test
from ship_trl.study.analysis.study import Study
from ship_trl.study.claims.kinds import Hypothesis, beats
from ship_trl.study.claims.kinds import steady as varies_less
from ship_trl.study.claims.verdicts import ALL
from ship_trl.study.sensitivity import MEANS, PLAN, SWAPPED, answers, by_means, main, others, rows
from tests.command import ship_trl
from tests.study.synthetic import make_record, write_study

SEEDS = 15
RNG = np.random.default_rng(0)


def study_of(**arms: np.ndarray) -> Study:
    """Runs of pair high, each at one score throughout."""
    return Study(
        {
            ("pairs", "high", arm, seed): make_record(np.full(40, score), "pairs", "high", arm, seed)
            for arm, scores in arms.items()
            for seed, score in enumerate(scores)
        }
    )


def test_a_tail_that_the_plan_cuts_off_counts_in_means() -> None:
    scratch = 0.6 + RNG.normal(0, 0.01, SEEDS)
    better = scratch + 0.05 + RNG.normal(0, 0.005, SEEDS)
    better[:3] -= 0.5
    family = [Hypothesis("A", "5", "", [beats("high", "FE1", "scratch")])]
    found = answers(study_of(scratch=scratch, FE1=better), family)
    assert found[PLAN][0].word == "supported" and found[MEANS][0].word != "supported"
    ((name, plan, means, swapped, spreads, ties),) = rows(found)
    assert (name, plan, swapped, spreads, ties) == ("A", "supported", "supported", "", "") and means != plan
    assert [others(found, way) for way in (PLAN, MEANS, SWAPPED)] == [0, 1, 0]


def test_all_changes_of_place_are_counted_where_the_plan_draws_some() -> None:
    steady, other = (RNG.normal(0.6, sd, SEEDS) for sd in (0.045, 0.05))
    family = [Hypothesis("A", "5", "", [varies_less("high", "FE1", "scratch")])]
    found = answers(study_of(FE1=steady, scratch=other), family)
    drawn, every = (found[way][0].findings[0].p for way in (PLAN, SWAPPED))
    # Of each run one score, so that curves are a number a seed.
    _, exact, _ = spread_test(steady[:, None], other[:, None], 1, resamples=2**SEEDS)
    assert every == pytest.approx(exact) and every != drawn and (every * 2**SEEDS) % 1 == 0
    assert rows(found)[0][4] == f"{drawn:.2g} -> {every:.2g}"


def test_of_a_contradiction_the_other_side_is_shown() -> None:
    rng = np.random.default_rng(0)
    wild, calm = (rng.normal(0.6, sd, SEEDS) for sd in (0.045, 0.024))
    found = answers(
        study_of(FE1=wild, scratch=calm), [Hypothesis("A", "5", "", [varies_less("high", "FE1", "scratch")])]
    )
    drawn, every = (found[way][0].findings[0].against for way in (PLAN, SWAPPED))
    assert found[PLAN][0].word == "contradicted" and drawn != every
    # No test of so many changes has a p of nothing.
    assert rows(found)[0][4] == f"{drawn:.2g} -> {every:.2g}" and every >= 2**-SEEDS


def test_of_too_many_seeds_not_all_changes_are_counted() -> None:
    many = study_of(**{arm: RNG.normal(0.6, 0.02, 20) for arm in ("FE1", "scratch")})
    found = answers(many, [Hypothesis("A", "5", "", [varies_less("high", "FE1", "scratch")])])
    assert SWAPPED not in found and rows(found)[0][3:5] == ["-", ""]


def test_the_t_tests_are_students() -> None:
    values = RNG.normal(0.02, 0.03, 10)
    found = by_means(contrast("A", "", "area", values, margin=0.05))
    assert found.p == pytest.approx(stats.ttest_1samp(values, 0, alternative="greater").pvalue)
    assert found.p + found.against == pytest.approx(1)
    upper = stats.ttest_1samp(values, 0.05, alternative="less").pvalue
    assert found.within == pytest.approx(
        max(upper, stats.ttest_1samp(values, -0.05, alternative="greater").pvalue)
    )
    no_more = by_means(contrast("A", "", "area", values, margin=0.05, claimed=Claimed.no_more))
    assert no_more.p == pytest.approx(upper) and no_more.against == pytest.approx(1 - upper)
    above = by_means(contrast("A", "", "time", values))
    assert above.p == pytest.approx(found.p) and above.against == pytest.approx(found.against)
    unknown = by_means(contrast("A", "", "time", values, claimed=Claimed.no_more))
    assert unknown.p == unknown.against == unknown.within == 1
    same = contrast("A", "", "time", np.full(5, 0.1))
    assert by_means(same) == same


def test_seeds_that_agree_are_counted() -> None:
    family = [Hypothesis("A", "5", "", [beats("high", "FE1", "scratch")])]
    scratch = np.array([0.5, 0.5, 0.5, 0.625, 0.25])
    found = answers(study_of(scratch=scratch, FE1=scratch + np.array([1, 1, 1, 0, 2]) / 8), family)
    assert rows(found)[0][-1] == "3"
    # Sums of the same numbers, which differ in their last bit.
    scratch = np.array([0.3, 0.5, 0.7, 0.9, 1.1]) / 2
    assert len(set((scratch + 0.1 - scratch).tolist())) > 1
    assert rows(answers(study_of(scratch=scratch, FE1=scratch + 0.1), family))[0][-1] == "5"


def test_every_claim_has_a_row(tmp_path: Path) -> None:
    write_study(tmp_path, seeds=5)
    told = ship_trl(str(tmp_path), folder=tmp_path, verb="sensitivity").stdout
    assert re.findall(r"^│ ([CH]\w+) +│", told, re.MULTILINE) == [claim.name for claim in ALL]
    for way in ("means", "all changes of place"):
        assert re.search(rf"^By {way} \d+ of {len(ALL)} verdicts are others\.$", told, re.MULTILINE)
    # A row is a line, however wide.
    assert sum(line.startswith("│") for line in told.splitlines()) == len(ALL)


def test_a_run_that_cannot_be_read_is_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write_study(tmp_path, seeds=2)
    (tmp_path / "pairs/high/FE1/seed=0/result.json").write_text("{")
    main([str(tmp_path)])
    said = capsys.readouterr().err
    assert "FE1/seed=0" in said and said.endswith("; left out\n") and said.count("\n") == 1


def test_a_folder_that_no_system_has_is_one_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        main(["a" * 300])
    said = capsys.readouterr().err
    assert ended.value.code == 1 and said.startswith("ship_trl: ") and said.count("\n") == 1


def test_a_folder_without_runs_is_one_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        main([str(tmp_path)])
    assert ended.value.code == 1
    assert (
        capsys.readouterr().err
        == f"ship_trl: folder: no finished run below {tmp_path}; python -m ship_trl study makes some\n"
    )
