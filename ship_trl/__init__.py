"""ship_trl: work process transfer reinforcement learning in ship collision avoidance."""

from __future__ import annotations

from collections.abc import Mapping
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from ship_trl.config.types import World
    from ship_trl.policies.checked import CheckedPolicy
    from ship_trl.sim.cases import Case, Suite
    from ship_trl.sim.env import ShipEnv

__version__ = "0.1.0"


def make_env(
    suite: Suite | Case | str,
    world: World | None = None,
    num_envs: int = 1,
    config: Mapping[str, Any] | None = None,
    **given: Any,
) -> ShipEnv:
    """Make the batched environment, with compiled loops on a CPU and CUDA graphs on a GPU.

    Args:
        suite: a case or suite, or its name, or the path of a YAML file: "4", "imazu".
        world: physics and reward; None for conf/world/paper.yaml.
        num_envs: number of own ships.
        config: of a name or path, changes such as `{"world": {"dt": 0.5}, "traffic": {"reacting": 1}}`, see
            `ship_trl.foreign.suites.load_changed`.
        given: further arguments of `ship_trl.sim.env.ShipEnv`; `fast=False` leaves everything to torch.

    Raises:
        ConfigError: there is no such case, or a key of `config` is unknown or wrong.
    """
    from ship_trl.config.errors import require
    from ship_trl.fast import worlds
    from ship_trl.foreign.suites import load_changed
    from ship_trl.sim.cases import load_world

    if isinstance(suite, str):
        suite, world = load_changed(suite, config, world)
    else:
        require(config is None, "config", "left out without the name of a case or suite", config)
    return worlds.make_env(suite, world or load_world(), num_envs, **given)


def load_policy(name: str | PathLike[str], case: str | None = None, seed: int = 0) -> CheckedPolicy:
    """Load a policy for one scene after the other: `action, _ = policy.predict(observation)`.

    `ship_trl.load_policy("traffic")` is the bundled network of random encounters. `policy.observation` says
    what it takes: "pixels" or "vector", which `gymnasium.make(..., **policy.env_options)` gives, or "state",
    the scene in `info["state"]`. TorchRL calls it with a tensordict: it reads `state` and writes `action`.

    Args:
        name: a bundled network ("1", "traffic", ...); the folder of a run, whose best network is taken; or
            any policy that `python -m ship_trl evaluate` takes: a planner (vo, sb_mpc, apf), a file, ...
            Masks may follow: "traffic+shield".
        case: the case or suite that it is made for, by name or path of a YAML file; most act in any. Default:
            that of the network, else random encounters.
        seed: seed of its random numbers.

    Raises:
        ConfigError: there is no such policy or case.
    """
    from ship_trl.config.errors import ConfigError
    from ship_trl.policies import named, pretrained
    from ship_trl.policies.registry import kind_of, split_masks
    from ship_trl.run.entries import drop_last_networks, find_entries

    (word, masks), bundled = (
        split_masks(str(name)),
        [one.name for one in (*pretrained.networks(), *pretrained.suites())],
    )
    if word in bundled:
        word = f"{pretrained.PRETRAINED}:{word}"
    elif not Path(word).is_dir() and not pretrained.is_pretrained(word):
        kind_of(word, bundled)
        case = case or "traffic"
    entries = drop_last_networks(find_entries([word, *([f"target={case}"] if case else [])], False))
    if len(entries) > 1:
        raise ConfigError(f"policy: {name} names several networks; allowed: one, as {entries[0].label}")
    policy = named.load_policy(
        entries[0].masked(masks).policy, make_env(entries[0].suite, entries[0].world), seed
    )
    policy.name = str(name)
    return policy
