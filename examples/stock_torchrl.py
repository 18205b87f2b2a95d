"""Train on the ship environment with nothing but TorchRL's own parts.

    python examples/stock_torchrl.py --steps 20000

Collector, epsilon-greedy module, replay buffer, loss and target updater are TorchRL's. What is ours is the
environment, the network, and the transform that draws pixels when a batch is learned from; each can be left
out for one of your own. For a learner that is a multiple faster, see `ship_trl/learn/double_dqn.py`.
"""

import argparse

import torch
from tensordict.nn import TensorDictSequential
from torch import Generator
from torchrl.collectors import Collector
from torchrl.data import LazyTensorStorage, TensorDictReplayBuffer
from torchrl.modules import EGreedyModule
from torchrl.objectives import DQNLoss, SoftUpdate

from ship_trl import make_env
from ship_trl.learn.network import DuelingNetwork
from ship_trl.learn.replay import DrawStates
from ship_trl.learn.rollout import greedy_policy, rollout


def main() -> None:
    """Train, and print what the greedy policy reaches."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--case", default="2")
    parser.add_argument("--steps", type=int, default=20_000, help="of the environment")
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args()
    torch.manual_seed(given.seed)
    torch.set_num_threads(1)

    env = make_env(given.case, num_envs=4)
    network = DuelingNetwork(1, env.action_spec.n, Generator().manual_seed(given.seed))
    policy = greedy_policy(network, env.rasteriser)
    exploration = EGreedyModule(env.action_spec, annealing_num_steps=given.steps // 2, eps_end=0.01)
    # State alone is stored: a picture is 7 kB, a state 36 to 76 bytes.
    collector = Collector(
        env,
        TensorDictSequential(policy, exploration),
        frames_per_batch=16,
        total_frames=given.steps,
        auto_register_policy_transforms=False,
        postproc=lambda steps: steps.exclude("pixels", "action_value", "chosen_action_value"),
    )
    replay = TensorDictReplayBuffer(
        storage=LazyTensorStorage(10_000), batch_size=32, transform=DrawStates(env.rasteriser)
    )
    loss_module = DQNLoss(policy[1], double_dqn=True, action_space="categorical", loss_function="smooth_l1")
    loss_module.make_value_estimator(gamma=0.95)
    target_update = SoftUpdate(loss_module, tau=0.02)
    optimiser = torch.optim.Adam(loss_module.parameters(), lr=5e-4)

    for steps in collector:
        exploration.step(steps.numel())
        steps["next", "reward"] *= 0.1
        replay.extend(steps.reshape(-1))
        if len(replay) < min(1_000, given.steps // 2):
            continue
        for _ in range(4):
            loss = loss_module(replay.sample())["loss"]
            optimiser.zero_grad()
            loss.backward()
            optimiser.step()
            target_update.step()
    episode = rollout(env, policy)[0]
    print(f"case {given.case}: return {episode.episode_return:.1f}, {episode.outcome}")


if __name__ == "__main__":
    main()
