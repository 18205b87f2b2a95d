"""A transfer is measured on its source during training, and learns the same as without."""

import dataclasses
import re
from itertools import pairwise

import pandas as pd
import pytest

from ship_trl.config.types import Schedule
from ship_trl.files.curve import CURVE
from ship_trl.files.record import read_run
from ship_trl.run.experiment import run_experiment
from ship_trl.run.plan import Run, make_run
from ship_trl.run.setup import MAX_EVALUATIONS, SourceCheck
from tests.command import files
from tests.config.test_config import composed

LINE = ("profile=smoke", "+pair=high", "+arm=FT3", "learn.jumpstart_draws=1")


def planned(*words: str) -> Run:
    return make_run(composed(*words))


@pytest.mark.parametrize(
    ("episodes", "every", "count"),
    [(600, 5, 20), (5000, 50, 20), (95, 5, 20), (9, 3, 4), (10, 3, 5), (1, 7, 2)],
)
def test_at_most_so_many_evaluations_are_measured_evenly(episodes: int, every: int, count: int) -> None:
    check = SourceCheck(None, None, Schedule(episodes, 1, every, 1, 0), 0.0)  # type: ignore[arg-type]
    evaluated = sorted({*range(0, episodes, every), episodes})
    due = [number for number, episode in enumerate(evaluated) if check.is_due(episode)]
    assert len(due) == count <= MAX_EVALUATIONS and (due[0], due[-1]) == (0, len(evaluated) - 1)
    gaps = {after - before for before, after in pairwise(due)}
    assert max(gaps) - min(gaps) <= 1


@pytest.mark.parametrize("observation", ["pixels", pytest.param("vector", marks=pytest.mark.long)])
def test_what_is_learned_has_the_same_bits_without_it(
    observation: str, capsys: pytest.CaptureFixture[str]
) -> None:
    # No bundled network of case 1 sees vectors, so that source is trained here.
    words = *LINE, f"observation={observation}", *("source=pretrained",) * (observation == "pixels")
    run, other = (planned(*words, f"output={name}") for name in ("one", "other"))
    result = run_experiment(run)
    told = re.search(r"^Forgetting on case 1: (\S+) before, (\S+) after$", capsys.readouterr().out, re.M)
    assert told is not None and result.on_source is not None
    assert told.groups() == (f"{result.on_source.network:.1f}", f"{result.on_source.final:.1f}")
    run_experiment(dataclasses.replace(other, source_suite=None))
    assert "Forgetting" not in capsys.readouterr().out.partition("case 1 -> case 2")[2]
    kept, left = files(run.folder), files(other.folder)
    for name in ("policy.safetensors", "policy_last.safetensors"):
        assert kept[name] == left[name]
    curve, without = (pd.read_csv(one.folder / CURVE) for one in (run, other))
    assert curve.drop(columns="source_return").equals(without.drop(columns="source_return"))
    assert without["source_return"].isna().all() and curve["source_return"].notna().sum() == 3
    assert read_run(other.folder).on_source is None and run.config_hash == other.config_hash
    measured, source = curve["source_return"].dropna(), result.on_source
    assert source is not None and read_run(run.folder) == result
    assert (source.before, source.final) == (measured.iloc[0], measured.iloc[-1])
    if observation == "pixels":
        assert source.best_known == pytest.approx(source.network, abs=10)
        assert source.random < -100 < 0 < source.network


@pytest.mark.parametrize(
    "words",
    [
        ("target=4", "method=scratch"),
        ("+pair=high", "+arm=FE3-random"),
        ("+pair=high", "+arm=FE3-permuted"),
        ("source=traffic", "target=4", "+arm=FT3", "source_weights=pretrained"),
    ],
)
def test_where_no_source_was_learned_or_it_is_drawn_there_is_nothing_to_measure(words: tuple[str]) -> None:
    assert planned(*words).source_suite is None
