"""A policy on a case, by name, and its episodes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from ship_trl.config.types import World
from ship_trl.sim.cases import Case

if TYPE_CHECKING:
    from ship_trl.learn.rollout import Episode, Policy
    from ship_trl.sim.env import ShipEnv

# What a table shows of a return; a claim that is farther off than this is another one.
SHOWN = 0.05


@dataclass(frozen=True)
class Entry:
    """A policy by its name, on a case; `claimed` is the return that it is said to have."""

    policy: str
    label: str
    case: Case
    world: World
    colour: bool
    claimed: float | None = None


def sail(entry: Entry, episodes: int = 1, seed: int = 0) -> tuple[ShipEnv, Policy, list[Episode]]:
    """Sail so many episodes at once: returns the environment, the policy, and what was sailed.

    Args:
        entry: the policy and its case.
        episodes: at least 1.
        seed: of policies that draw.

    Raises:
        ConfigError: there is no such policy, or its file is not right.
    """
    from ship_trl.learn.rollout import rollout
    from ship_trl.policies.named import POLICIES, load_policy
    from ship_trl.sim.env import ShipEnv

    # Networks from a file draw for themselves, and ours without training read the state alone.
    pixels = entry.policy not in POLICIES and not entry.policy.endswith(".safetensors")
    env = ShipEnv(entry.case, entry.world, episodes, colour=entry.colour, from_pixels=pixels)
    policy = load_policy(entry.policy, env, seed)
    return env, policy, rollout(env, policy)
