"""A policy of one's own: steer for the goal, and give way to whoever would come too near.

    python -m ship_trl evaluate examples/own_policy.py:policy best_known target=2,4,6

Of the seven actions it takes the one that points nearest to the goal, among those whose course, if kept,
would pass every target ship farther off than the safe distance. It knows their courses, and learns nothing.
"""

import math

import torch
from tensordict import TensorDictBase
from torch import Tensor

from ship_trl.learn.rollout import Policy, rollout
from ship_trl.sim.cases import load_case, load_world
from ship_trl.sim.env import ShipEnv

# Metres beyond the safe distance, and seconds ahead that are looked at.
MARGIN, AHEAD = 5.0, 25.0


def policy(env: ShipEnv, seed: int = 0) -> Policy:
    """Make the policy for an environment; it draws no random number."""
    del seed
    world, case = env.world, env.case
    actions, goal = torch.tensor(world.actions), torch.tensor(case.goal)
    ships = case.target_ships
    start = torch.tensor([[ship.x, ship.y] for ship in ships]).reshape(-1, 2)
    course = torch.tensor([math.radians(ship.heading) for ship in ships])
    speed = torch.tensor([ship.speed for ship in ships])[:, None]
    drift = speed * torch.stack((course.cos(), course.sin()), -1)

    def nearest(place: Tensor, heading: Tensor, time: Tensor) -> Tensor:
        """Least distance to any ship of each action's course, if kept: [N, A] in metres."""
        own = actions[:, :1] * torch.stack((heading.cos(), heading.sin()), -1)
        away = (start + drift * time[:, None, None] - place[:, None])[:, None]
        apart = drift - own[:, :, None]
        when = -(away * apart).sum(-1) / apart.square().sum(-1).clamp(min=1e-6)
        closest = away + when.clamp(0.0, AHEAD)[..., None] * apart
        return closest.norm(dim=-1).amin(-1) if len(ships) else torch.full(heading.shape, math.inf)

    def act(step: TensorDictBase) -> TensorDictBase:
        place, heading, time = step["state"].split((2, 1, 1), -1)
        heading = heading + actions[:, 1] * world.dt
        bearing = torch.atan2(goal[1] - place[:, 1], goal[0] - place[:, 0])[:, None]
        off = torch.remainder(bearing - heading + math.pi, 2 * math.pi) - math.pi
        room = nearest(place, heading, time[:, 0] * world.dt) - world.safe_distance - MARGIN
        # A hundred times the angle for each metre that is missing; then straight ahead, then fast.
        cost = off.abs() + 100.0 * (-room).clamp(min=0.0) - 1e-3 * actions[:, 0]
        return step.set("action", cost.argmin(-1))

    return act


def main() -> None:
    """Sail the cases with ships, and print how each ends."""
    world = load_world()
    for name in ("2", "4", "6"):
        env = ShipEnv(load_case(name, world), world)
        (episode,) = rollout(env, policy(env))
        print(
            f"case {name}: return {episode.episode_return:.1f}, {episode.outcome}, DCPA {episode.dcpa:.0f} m"
        )


if __name__ == "__main__":
    main()
