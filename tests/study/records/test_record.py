"""Whole runs are read, and what is not whole is named."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from ship_trl.files.curve import CURVE, RunError
from ship_trl.files.record import read_whole
from ship_trl.study.metrics import dip, late_misses
from ship_trl.study.tables import read_runs
from tests.study.synthetic import learning, write_run


def test_a_run_is_read_as_it_was_written(tmp_path: Path) -> None:
    scores = learning(np.random.default_rng(0), 50)
    record = read_whole(write_run(tmp_path, scores, arm="FE3", seed=4, before=0.2), "pairs")
    assert record.place == ("pairs", "high", "FE3") and record.seed == 4
    np.testing.assert_allclose(record.score(record.training.returns), scores, atol=2e-6)
    assert record.score(record.before.episode_return) == pytest.approx(0.2)
    assert record.greedy.episode.tolist() == [0, 20, 40, 50]
    assert (record.training.goal == (record.training.returns > 0)).all()
    assert np.isnan(record.greedy.dcpa[0]) and record.greedy.dcpa[-1] == 60.0


@pytest.mark.parametrize("rows", [slice(0, None), slice(3, 4)])
def test_a_curve_may_have_no_epsilon_but_not_lack_one(tmp_path: Path, rows: slice) -> None:
    place = write_run(tmp_path, learning(np.random.default_rng(0), 50))
    curve = pd.read_csv(place / CURVE)
    curve.loc[curve.index[rows], "epsilon"] = np.nan
    curve.to_csv(place / CURVE, index=False)
    if rows.stop is None:
        record = read_whole(place)
        assert np.isnan(record.training.epsilon).all()
        # The last tenth stands for the episodes after exploration.
        assert dip(record) >= 0 and len(late_misses(record)) == 5
    else:
        with pytest.raises(RunError, match="not finite"):
            read_whole(place)


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"episodes": 49}, "curve.csv does not have the 49 episodes"),
        ({"episodes": 10**12}, "curve.csv does not have the 1000000000000 episodes"),
        ({"best_known_return": float("nan")}, "best_known_return: must be a finite number, got NaN"),
        ({"arm": "FE3-shown"}, "result.json: 'FE3-shown' names no arm"),
        ({"random_return": None}, "random_return: must be a valid number, got null"),
        ({"random_return": 100.0}, "the best known return is not above the random one"),
        ({"untrained": {}}, "untrained.return: missing"),
        ({"draws": [1.0, None]}, r"draws\[1\]: must be a valid number, got null"),
    ],
)
def test_results_that_make_no_sense_are_named(tmp_path: Path, changes: dict[str, Any], said: str) -> None:
    place = write_run(tmp_path, learning(np.random.default_rng(0), 50))
    result = json.loads((place / "result.json").read_text())
    (place / "result.json").write_text(json.dumps(result | changes))
    with pytest.raises(RunError, match=said):
        read_whole(place)


def test_the_untrained_network_is_found_under_its_old_name_too(tmp_path: Path) -> None:
    place = write_run(tmp_path, learning(np.random.default_rng(0), 50))
    result = json.loads((place / "result.json").read_text())
    before = read_whole(place).untrained
    result["scratch"] = result.pop("untrained")
    (place / "result.json").write_text(json.dumps(result))
    assert read_whole(place).untrained == before


def test_runs_are_found_with_their_part_and_the_case_base_is_not_one(tmp_path: Path) -> None:
    scores = learning(np.random.default_rng(0), 20)
    write_run(tmp_path / "pairs", scores)
    write_run(tmp_path / "reuse/epsilon_low", scores, seed=3)
    write_run(tmp_path / "case_base", scores)
    (tmp_path / "pairs/low/FE1/seed=2").mkdir(parents=True)
    broken: list[tuple[Path, str]] = []
    found = [(str(run.folder.relative_to(tmp_path)), run.part) for run in read_runs(tmp_path, broken)]
    assert found == [
        ("pairs/high/scratch/seed=0", "pairs"),
        ("reuse/epsilon_low/high/scratch/seed=3", "reuse/epsilon_low"),
    ]
    assert broken == [(tmp_path / "pairs/low/FE1/seed=2", "result.json is missing")]
