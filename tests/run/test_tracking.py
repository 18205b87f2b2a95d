"""The rows of the CSV, and the names of numbers in wandb and TensorBoard."""

import csv
import math
from dataclasses import replace
from pathlib import Path

import torch

from ship_trl.learn.rollout import Episode
from ship_trl.learn.train import Evaluated, Finished
from ship_trl.run.history import to_numbers, to_row
from ship_trl.run.plan import make_run
from ship_trl.run.trackers import Trackers
from ship_trl.run.trackers.csv import CsvTracker
from tests.config.test_config import composed

EPISODE = Episode(
    states=torch.zeros(3, 4),
    actions=torch.zeros(2, dtype=torch.int64),
    q_values=torch.zeros(2, 7),
    rewards=torch.tensor([-1.5, -2.0]),
    goal=False,
    collision=True,
    dcpa=44.0,
)
FINISHED = Finished(3, 90, 0.5, 0.1 + 0.2, 30, "goal", math.inf, None)


def test_numbers_are_named_by_chart() -> None:
    trained, greedy = to_numbers(to_row(FINISHED)), to_numbers(to_row(Evaluated(3, 90, [EPISODE])))
    assert (trained["train/return"], trained["train/goal"], trained["train/collision"]) == (0.1 + 0.2, 1, 0)
    assert (greedy["greedy/return"], greedy["greedy/goal"], greedy["greedy/collision"]) == (-3.5, 0, 1)
    assert all(name.startswith("train/") for name in trained) and "train/loss" not in trained
    assert all(name.startswith("greedy/") for name in greedy) and "greedy/episode" not in greedy


def test_csv_keeps_every_digit_and_is_flushed_after_each_row(tmp_path: Path) -> None:
    run = make_run(composed("target=1", "method=scratch"))
    tracker = CsvTracker(replace(run, folder=tmp_path))
    tracker.begin()
    tracker.log(to_row(FINISHED))
    with (tmp_path / "curve.csv").open() as file:  # before it is closed
        (first,) = csv.DictReader(file)
    assert float(first["return"]) == 0.1 + 0.2 and first["loss"] == "" and first["dcpa"] == ""
    tracker.log(to_row(Evaluated(3, 90, [EPISODE])))
    tracker.close(failed=False)
    with (tmp_path / "curve.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert rows[1]["greedy_outcome"] == "collision" and rows[1]["return"] == ""


def test_a_new_run_replaces_an_unfinished_one(tmp_path: Path) -> None:
    run = make_run(composed("target=1", "method=scratch", f"output={tmp_path}"))
    run.folder.mkdir(parents=True)
    (run.folder / "curve.csv").write_text("left over")
    with Trackers(run) as tracker:
        tracker.log(to_row(FINISHED))
    assert sorted(p.name for p in run.folder.iterdir()) == ["checkpoint", "config.yaml", "curve.csv"]
    assert "left over" not in (run.folder / "curve.csv").read_text()
