"""A sweep's last line; that of a real sweep is in tests/run/test_objective.py."""

from pathlib import Path

import pytest
from omegaconf import OmegaConf

from ship_trl.run.sweep import RESULTS, BestTrial


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (
            "best_params: {learn.lr: 0.001, seed: 3}\nbest_value: 81.26\n",
            "best trial: learn.lr=0.001 seed=3, late 81.3; ",
        ),
        ('best_params: {"a\\nb": 1}\nbest_value: 2\n', "best trial: "),
        ("solutions: []\n", ""),
        ("best_params: 3\nbest_value: 2\n", ""),
        ("best_params: {}\nbest_value: much\n", ""),
        ("[", ""),
        ("- 1\n", ""),
        (None, ""),
    ],
)
def test_the_best_trial_is_one_line_or_none(
    text: str | None, said: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    if text is not None:
        (tmp_path / RESULTS).write_text(text)
    BestTrial().on_multirun_end(
        OmegaConf.create({"objective": "late", "hydra": {"sweep": {"dir": str(tmp_path)}}})
    )
    told = capsys.readouterr().out
    assert told.startswith(said) and told.count("\n") == bool(said)
    assert not said or told.endswith(f"{tmp_path / RESULTS}\n")
