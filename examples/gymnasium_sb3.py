"""Train Stable-Baselines3's DQN on the ship environment: the same world, for Gymnasium.

    pip install stable-baselines3
    python examples/gymnasium_sb3.py --case 2 --steps 50000

Rewards are those of the paper times 0.01, as the paper's learner has them here. The model is saved, and
evaluated as by `python -m ship_trl evaluate trusted:sb3.zip pretrained target=2`. Loading its file runs the
pickles in it; `trusted:` says that you trust who made it.
"""

import argparse

import gymnasium
import torch
from stable_baselines3 import DQN

from ship_trl.cli.evaluate import main as evaluate


def main() -> None:
    """Train, save, and evaluate."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--case", default="2")
    parser.add_argument("--steps", type=int, default=50_000)
    given = parser.parse_args()
    torch.set_num_threads(1)
    env = gymnasium.make("ship_trl.gym:ShipCollision-v0", case=given.case, reward_scale=0.01)
    model = DQN("CnnPolicy", env, buffer_size=10_000, learning_starts=min(1_000, given.steps // 2), seed=0)
    model.learn(given.steps)
    model.save("sb3.zip")
    evaluate(["trusted:sb3.zip", "pretrained", f"target={given.case}"])


if __name__ == "__main__":
    main()
