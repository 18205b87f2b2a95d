"""Each example runs as its first lines say."""

import sys
from pathlib import Path

import numpy as np
import pytest
import torch
from PIL import Image
from tensordict import TensorDict
from torchrl.modules import QValueActor

from ship_trl.cli.evaluate import main
from ship_trl.learn.loss import ForeachSoftUpdate
from tests.command import ROOT
from tests.forked import run_script

EXAMPLES = sorted((ROOT / "examples").glob("*.py"))
DRAWS = {"huber_threshold": "huber_threshold.png"}
ARGUMENTS = {
    "huber_threshold": [DRAWS["huber_threshold"]],
    "own_loss": ["200"],
    "stock_torchrl": ["--steps", "400"],
    "gymnasium_sb3": ["--steps", "300"],
    "study_in_pandas": [str(ROOT / "outputs/quick_study/report/runs.csv")],
}
MAX_LINES = 80


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)
def test_an_example_runs(path: Path, tmp_path: Path) -> None:
    ended = run_script(path, *ARGUMENTS.get(path.stem, []), folder=tmp_path)
    assert ended.code == 0, ended
    if path.stem in DRAWS:
        picture = np.asarray(Image.open(tmp_path / DRAWS[path.stem]))
        assert picture.std() > 5


def test_torchrl_alone_takes_few_lines() -> None:
    assert len((ROOT / "examples" / "stock_torchrl.py").read_text().splitlines()) <= MAX_LINES


def test_the_example_loss_is_pessimistic() -> None:
    sys.path.insert(0, str(ROOT / "examples"))
    from own_loss import CautiousLoss

    network = torch.nn.Linear(2, 7)
    loss = CautiousLoss(QValueActor(network, in_keys=["pixels"], action_space="categorical"), gamma=0.0)
    ForeachSoftUpdate(loss, tau=0.1)
    state, action = torch.rand(2, 2), torch.tensor([1, 2])
    q = network(state).gather(-1, action[:, None]).detach()
    after = {"pixels": state, "reward": q + torch.tensor([[1.0], [-1.0]]), "terminated": torch.ones(2, 1) > 0}
    batch = TensorDict({"pixels": state, "action": action, "next": after}, batch_size=[2])
    # A mean of 1 for the first, which is too low by 1, and of 2 for the second.
    assert float(loss(batch)["loss"].detach()) == pytest.approx(1.5)


def test_a_collision_is_forgotten_with_a_small_threshold() -> None:
    sys.path.insert(0, str(ROOT / "examples"))
    from huber_threshold import COLLISION, settled

    for share in (0.1, 0.25):
        assert settled(1.0, share) == pytest.approx(-share / (1 - share), abs=0.05)
        assert settled(10.0, share) == pytest.approx(-10 * share / (1 - share), abs=0.05)
        assert settled(20.0, share) == pytest.approx(COLLISION * share, abs=0.05)


def test_the_example_policy_gives_way(capsys: pytest.CaptureFixture[str]) -> None:
    main([f"{ROOT / 'examples/own_policy.py'}:policy", "keep_course", "target=4", "--markdown"])
    own, kept = capsys.readouterr().out.splitlines()[2:4]
    assert "| goal |" in own and "| collision |" in kept
