"""Train with a loss of one's own: a Q-value that is too high costs more than one that is too low.

python examples/own_loss.py 20000      # replay and policies are the project's, optimiser and updater stock
"""

import sys

import torch
from tensordict import TensorDict, TensorDictBase
from torchrl.modules import QValueActor
from torchrl.objectives import SoftUpdate

from ship_trl import make_env
from ship_trl.learn.network import DuelingNetwork
from ship_trl.learn.q_learning import DoubleDQNLoss
from ship_trl.learn.replay import DrawStates, StateReplay
from ship_trl.learn.rollout import EpsilonGreedy, greedy_policy, rollout


class CautiousLoss(DoubleDQNLoss):
    """Squared errors of double DQN, those of Q-values above their target twofold."""

    def forward(self, batch: TensorDictBase) -> TensorDict:
        """Compute the loss of transitions [B]."""
        with torch.no_grad():
            choice = self.network(batch["next", "pixels"]).argmax(-1, keepdim=True)
            value = self.target_network(batch["next", "pixels"]).gather(-1, choice)
            td_target = batch["next", "reward"] + self.gamma * value * ~batch["next", "terminated"]
        error = self.network(batch["pixels"]).gather(-1, batch["action"].unsqueeze(-1)) - td_target
        return TensorDict({"loss": (error.square() * (1.0 + (error > 0))).mean()})


def main(steps: int) -> None:
    """Train on case 2, and print what the greedy policy reaches."""
    torch.set_num_threads(1)
    generators = [torch.Generator().manual_seed(seed) for seed in range(3)]
    env = make_env("2", num_envs=4)
    draw, actions = env.rasteriser, env.action_spec.n
    network = DuelingNetwork(1, actions, generators[0])
    loss = CautiousLoss(QValueActor(network, in_keys=["pixels"], action_space="categorical"), gamma=0.95)
    target_update, optimiser = SoftUpdate(loss, tau=0.02), torch.optim.Adam(network.parameters(), 5e-4)
    replay = StateReplay(10_000, 0.1, generators[1], env.device, transform=DrawStates(draw))
    policy = EpsilonGreedy(lambda state: network(draw(state)).argmax(-1), "state", actions, generators[2])
    current = env.reset()
    for time in range(0, steps, env.batch_size[0]):
        policy.epsilon = max(0.01, 1.0 - 2.0 * time / steps)
        stepped, current = env.step_and_maybe_reset(policy(current))
        replay.extend(stepped)
        if time >= min(1_000, steps // 2):
            optimiser.zero_grad()
            loss(replay.sample(32))["loss"].backward()
            optimiser.step()
            target_update.step()
    episode = rollout(env, greedy_policy(network, draw))[0]
    print(f"case 2: return {episode.episode_return:.1f}, {episode.outcome}")


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 20_000)
