"""Give Stable-Baselines3's DQN the conv layers of a trained network, frozen or to be finetuned.

    pip install stable-baselines3
    python examples/sb3_extractor.py --source pretrained:1 --case 2 --freeze

`--source` is `pretrained:NAME` or a policy.safetensors of a run of the paper's network. Frozen layers get no
gradient, so that Adam passes over them.
"""

import argparse
from pathlib import Path

import gymnasium
import torch
from stable_baselines3 import DQN
from stable_baselines3.common.evaluation import evaluate_policy
from stable_baselines3.common.torch_layers import BaseFeaturesExtractor
from torch import Generator, Tensor

from ship_trl.learn.network import DuelingNetwork
from ship_trl.policies.pretrained import networks
from ship_trl.transfer.weights import load_weights


def find(source: str) -> Path:
    """Return the file of a bundled network by its name, or the path itself."""
    bundled = {f"pretrained:{one.name}": one.file for one in networks()}
    return bundled.get(source, Path(source))


class ConvLayers(BaseFeaturesExtractor):
    """The conv layers of a trained network: pixels float [B, 1, 84, 84], 0 to 255, to features [B, 200]."""

    def __init__(self, space: gymnasium.spaces.Box, actions: int, weights: str, freeze: bool) -> None:
        network = DuelingNetwork(1, actions, Generator())
        network.load_state_dict(dict(load_weights(find(weights), network)))
        super().__init__(space, features_dim=network.shared.in_features)
        # Stable-Baselines3 has its own fully connected layers.
        for name in ("shared", "value", "advantage"):
            delattr(network, name)
        self.network = network.requires_grad_(not freeze)

    def forward(self, observations: Tensor) -> Tensor:
        """Compute the features."""
        return self.network.encode(observations)


def main() -> None:
    """Train, and print the greedy policy's raw return."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--source", default="pretrained:1")
    parser.add_argument("--case", default="2")
    parser.add_argument("--freeze", action="store_true")
    parser.add_argument("--steps", type=int, default=50_000)
    given = parser.parse_args()
    torch.set_num_threads(1)
    env = gymnasium.make("ship_trl.gym:ShipCollision-v0", case=given.case, reward_scale=0.01)
    assert isinstance(env.action_space, gymnasium.spaces.Discrete)
    extractor = {"actions": int(env.action_space.n), "weights": given.source, "freeze": given.freeze}
    model = DQN(
        "CnnPolicy",
        env,
        # The network divides by 255 itself.
        policy_kwargs={
            "features_extractor_class": ConvLayers,
            "features_extractor_kwargs": extractor,
            "normalize_images": False,
        },
        buffer_size=10_000,
        learning_starts=min(1_000, given.steps // 2),
        seed=0,
    )
    before = [one.clone() for one in model.q_net.features_extractor.parameters()]
    model.learn(given.steps)
    changed = sum(
        not torch.equal(one, other)
        for one, other in zip(before, model.q_net.features_extractor.parameters(), strict=True)
    )
    reached, _ = evaluate_policy(model, env, n_eval_episodes=1, warn=False)
    assert isinstance(reached, float)
    print(f"{changed} of {len(before)} tensors of the extractor changed")
    print(f"case {given.case}: return {reached / 0.01:.1f} after {given.steps} steps")


if __name__ == "__main__":
    main()
