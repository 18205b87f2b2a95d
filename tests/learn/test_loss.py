"""The loss is TorchRL's DQNLoss, to every digit."""

import copy

import pytest
import torch
from tensordict import TensorDict
from torch import Generator
from torchrl.data import Categorical
from torchrl.modules import QValueActor
from torchrl.objectives import DQNLoss

from ship_trl.config import Loss
from ship_trl.learn.loss import double_dqn_target, td_loss
from ship_trl.learn.network import DuelingNetwork
from tests.learn.worlds import draw


@pytest.mark.filterwarnings("ignore:No target network updater")
@pytest.mark.parametrize("kind", list(Loss))
def test_the_loss_is_that_of_torchrl(kind: Loss) -> None:
    generator = Generator().manual_seed(3)
    network = DuelingNetwork(1, 7, generator)
    slow = DuelingNetwork(1, 7, generator)
    reference = DQNLoss(
        QValueActor(copy.deepcopy(network), in_keys=["pixels"], spec=Categorical(7)),
        delay_value=True,
        double_dqn=True,
        loss_function="l2" if kind is Loss.l2 else "smooth_l1",
    )
    reference.make_value_estimator(gamma=0.9)
    target = reference.target_value_network_params.flatten_keys(".")
    for name, value in slow.named_parameters():
        (key,) = [key for key in list(target.keys()) if key.endswith(f".{name}")]
        target[key].data.copy_(value.data)

    state, later = torch.rand(2, 12, 2, generator=generator) * 8 - 4
    action = torch.randint(7, (12,), generator=generator)
    reward, terminated = torch.rand(12, 1, generator=generator), torch.arange(12)[:, None] % 3 == 0
    following = {
        "pixels": draw(later),
        "reward": reward,
        "done": torch.ones(12, 1, dtype=torch.bool),
        "terminated": terminated,
    }
    batch = TensorDict({"pixels": draw(state), "action": action, "next": following}, batch_size=[12])
    wanted = reference(batch)["loss"]

    with torch.no_grad():
        goal = double_dqn_target(network(draw(later)), slow(draw(later)), reward, terminated, 0.9)
    got = td_loss(network(draw(state)), action, goal, kind)
    assert torch.equal(got, wanted)
