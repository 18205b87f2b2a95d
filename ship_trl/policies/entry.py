"""A policy on a case, by name, and its episodes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from ship_trl.config.types import World
from ship_trl.sim.cases import Case

if TYPE_CHECKING:
    from ship_trl.learn.rollout import Episode, Policy
    from ship_trl.sim.env import ShipEnv

# Tables show one decimal: a return that differs by more than half of it is not the claimed one.
SHOWN = 0.05


@dataclass(frozen=True)
class Entry:
    """A policy by name on a case; `claimed` is the return in its result or manifest."""

    policy: str
    label: str
    case: Case
    world: World
    colour: bool
    claimed: float | None = None


def rollout_entry(entry: Entry, episodes: int = 1, seed: int = 0) -> tuple[ShipEnv, Policy, list[Episode]]:
    """Roll out episodes in one batch; return the environment, the policy and the episodes.

    Raises:
        ConfigError: there is no such policy, or its file is invalid.
    """
    from ship_trl.learn.rollout import rollout
    from ship_trl.policies.named import POLICIES, load_policy
    from ship_trl.sim.env import ShipEnv

    # Networks draw their own pixels, and policies without training read only the state.
    pixels = entry.policy not in POLICIES and not entry.policy.endswith(".safetensors")
    env = ShipEnv(entry.case, entry.world, episodes, colour=entry.colour, from_pixels=pixels)
    policy = load_policy(entry.policy, env, seed)
    return env, policy, rollout(env, policy)
