"""A complete result; a test changes the fields it is about."""

from typing import Any

from ship_trl.files.record import SCHEMA_VERSION, Evaluation, RunRecord


def an_evaluation(episode_return: float = 10.0, outcome: str = "goal", episode: int = 0) -> Evaluation:
    return Evaluation(episode_return, outcome, 40, 50.0, episode)


def a_result(**changes: Any) -> RunRecord:
    values: dict[str, Any] = {
        "pair": "high",
        "source": "1",
        "target": "2",
        "method": "finetune",
        "layers": 3,
        "arm": "FT3",
        "seed": 0,
        "profile": "quick",
        "config_hash": "0123456789ab",
        "source_network": None,
        "best_known_return": 80.0,
        "random_return": -320.0,
        "draws": [],
        **{key: an_evaluation() for key in ("untrained", "before", "best", "final")},
        "episodes": 50,
        "steps": 2000,
        "training_goal_rate": 0.5,
        "training_collision_rate": 0.25,
        "device": "cpu",
        "precision": "float32",
        "backend": "incremental",
        "ship_trl": "0.1.0",
        "torch": "2.13.0",
        "processor": "x86_64",
        "seconds": 12.5,
        "algorithm_version": 2,
        "schema_version": SCHEMA_VERSION,
    }
    return RunRecord(**values | changes)
