"""A policy of one's own: steer for the goal, and give way to a ship that would come too near.

    python -m ship_trl evaluate examples/own_policy.py:policy best_known target=2,4,6

Of the seven actions it takes the one that points nearest to the goal, among those whose course, if kept,
would pass every target ship outside the safe distance. It reads the scene, so it acts in any case.
"""

import math

import torch
from tensordict import TensorDictBase
from torch import Tensor

from ship_trl.fast.worlds import make_env
from ship_trl.learn.rollout import Policy, rollout
from ship_trl.sim.cases import load_case, load_world
from ship_trl.sim.env import ShipEnv
from ship_trl.sim.geometry import unit_vector, wrap_angle
from ship_trl.sim.state import (
    HEADING,
    SHIP_HEADING,
    SHIP_SPEED,
    goal,
    is_present,
    position,
    relative_positions,
    target_ships,
)

# Metres added to the safe distance, and seconds to look ahead.
MARGIN, AHEAD = 5.0, 25.0


def policy(env: ShipEnv, seed: int = 0) -> Policy:
    """Make the policy for an environment; it draws no random numbers."""
    del seed
    world = env.world
    actions = torch.tensor(world.actions)

    def nearest(state: Tensor, heading: Tensor) -> Tensor:
        """Return the least distance (m) to a target ship on each action's course, [N, A]."""
        ships = target_ships(state)
        drift = ships[..., SHIP_SPEED, None] * unit_vector(ships[..., SHIP_HEADING])
        velocity = drift[:, None] - (actions[:, :1] * unit_vector(heading))[:, :, None]
        away = relative_positions(state)[:, None]
        time = -(away * velocity).sum(-1) / velocity.square().sum(-1).clamp(min=1e-6)
        distance = (away + time.clamp(0.0, AHEAD)[..., None] * velocity).norm(dim=-1)
        distance = distance.masked_fill(~is_present(state)[:, None], math.inf)
        return distance.amin(-1) if distance.shape[-1] else torch.full(heading.shape, math.inf)

    def act(step: TensorDictBase) -> TensorDictBase:
        state = step["state"]
        heading = state[:, HEADING, None] + actions[:, 1] * world.dt
        east, north = (goal(state) - position(state)).unbind(-1)
        off = wrap_angle(torch.atan2(north, east)[:, None] - heading)
        room = nearest(state, heading) - world.safe_distance - MARGIN
        # A hundred times the angle for each missing metre; then straight ahead, then fast.
        cost = off.abs() + 100.0 * (-room).clamp(min=0.0) - 1e-3 * actions[:, 0]
        return step.set("action", cost.argmin(-1))

    return act


def main() -> None:
    """Roll out the cases with ships, and print how each ends."""
    world = load_world()
    for name in ("2", "4", "6"):
        env = make_env(load_case(name, world), world)
        (episode,) = rollout(env, policy(env))
        print(
            f"case {name}: return {episode.episode_return:.1f}, {episode.outcome}, "
            f"least distance {episode.dcpa:.0f} m"
        )


if __name__ == "__main__":
    main()
