"""Train Stable-Baselines3's DQN on the ship environment: the same world, for Gymnasium.

    pip install stable-baselines3
    python examples/gymnasium_sb3.py --case 2 --steps 50000

Rewards are those of the paper times 0.01, as the paper's learner has them here.
"""

import argparse

import gymnasium
import torch
from stable_baselines3 import DQN
from stable_baselines3.common.evaluation import evaluate_policy


def main() -> None:
    """Train, and print the greedy policy's raw return."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--case", default="2")
    parser.add_argument("--steps", type=int, default=50_000)
    given = parser.parse_args()
    torch.set_num_threads(1)
    env = gymnasium.make("ship_trl.gym:ShipCollision-v0", case=given.case, reward_scale=0.01)
    model = DQN("CnnPolicy", env, buffer_size=10_000, learning_starts=min(1_000, given.steps // 2), seed=0)
    model.learn(given.steps)
    reached, _ = evaluate_policy(model, env, n_eval_episodes=1, warn=False)
    assert isinstance(reached, float)
    print(f"case {given.case}: return {reached / 0.01:.1f} after {given.steps} steps")


if __name__ == "__main__":
    main()
