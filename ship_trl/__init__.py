"""ship_trl: work process transfer reinforcement learning in ship collision avoidance."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from ship_trl.config.types import World
    from ship_trl.learn.rollout import Policy
    from ship_trl.sim.cases import Case, Suite
    from ship_trl.sim.env import ShipEnv

__version__ = "0.1.0"


def make_env(
    suite: Suite | Case | str, world: World | None = None, num_envs: int = 1, **given: Any
) -> ShipEnv:
    """Make the batched environment, with compiled loops on a CPU and CUDA graphs on a GPU.

    Args:
        suite: a case or suite, or its name, or the path of a YAML file: "4", "imazu".
        world: physics and reward; None for conf/world/paper.yaml.
        num_envs: number of own ships.
        given: further arguments of `ship_trl.sim.env.ShipEnv`; `fast=False` leaves everything to torch.

    Raises:
        ConfigError: there is no such case.
    """
    from ship_trl.fast import worlds
    from ship_trl.formats.suites import load_suite
    from ship_trl.sim.cases import load_world

    world = world or load_world()
    begun = load_suite(suite, world, "case") if isinstance(suite, str) else suite
    return worlds.make_env(begun, world, num_envs, **given)


def load_policy(name: str, case: str | None = None, seed: int = 0) -> Policy:
    """Load a policy, which reads `state` of a tensordict and writes `action`.

    `ship_trl.load_policy("4")` is the trained network of case 4.

    Args:
        name: a bundled case, or `traffic`, for its network; or any policy that `python -m ship_trl evaluate`
            takes (random, best_known, a safetensors file, ...), except result folders, which hold several.
        case: the case or suite to act in, by name or path of a YAML file; default: the network's own.
        seed: seed of its random numbers.

    Raises:
        ConfigError: there is no such policy or case.
    """
    from ship_trl.config.errors import ConfigError
    from ship_trl.policies import named, pretrained
    from ship_trl.policies.registry import kind_of

    name, bundled = str(name), [one.name for one in (*pretrained.networks(), *pretrained.suites())]
    if name in bundled:
        name = f"{pretrained.PRETRAINED}:{name}"
    kind_of(name, bundled)
    if case is None and pretrained.is_pretrained(name) and name != pretrained.PRETRAINED:
        case = pretrained.find(name, None).target
    if case is None:
        raise ConfigError(f"case: none given for {name}; allowed: a case by name, or the path of a YAML file")
    return named.load_policy(name, make_env(str(case)), seed)
