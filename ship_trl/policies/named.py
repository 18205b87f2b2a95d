"""Load a policy of any kind by name, and roll it out on a suite.

A policy reads the environment's tensordict (`state` and `pixels`) and writes `action`.
"""

from __future__ import annotations

import math
import statistics
import time
from functools import partial
from pathlib import Path
from pkgutil import resolve_name
from typing import Any

from tensordict import TensorDictBase
from torch import Generator, Tensor, nn

from ship_trl.config.checks import MASKS
from ship_trl.config.errors import ConfigError
from ship_trl.config.imports import import_function, name_in_errors
from ship_trl.fast.worlds import draw_starts, make_env
from ship_trl.learn.network import DuelingNetwork, make_network
from ship_trl.learn.rollout import Episode, Policy, greedy_policy, rollout
from ship_trl.policies import recorded
from ship_trl.policies.checked import CheckedPolicy, describe
from ship_trl.policies.onnx import onnx_policy
from ship_trl.policies.pretrained import find
from ship_trl.policies.registry import EPISODES, POLICIES, TRUSTED, Entry, Kind, kind_of, split_masks
from ship_trl.policies.sb3 import sb3_policy
from ship_trl.sim.env import ShipEnv
from ship_trl.transfer.weights import Look, load_weights, read_look


def load_policy(name: str, env: ShipEnv, seed: int = 0, laid: tuple[str, ...] = ()) -> CheckedPolicy:
    """Load a policy for an environment; a network keeps the mask under which it was trained.

    Args:
        name: one of `registry.POLICIES`; `pretrained` (the bundled network for the environment's case or
            suite) or `pretrained:NAME`; a safetensors or ONNX file; `trusted:FILE.zip` of Stable-Baselines3;
            `file.py:function` or `module:function`, which is called with the environment and the seed.
        env: where it will act.
        seed: of its random numbers.
        laid: names of masks that are laid on it.

    Raises:
        ConfigError: there is no such policy, or its file is invalid; later, it is given what it cannot read,
            or a user's fails or writes an invalid action.
    """
    # Imported in this function: masks need numba, which a run does not.
    base, masks = split_masks(name)
    if masks:
        from ship_trl.policies.masks import Masked

        policy = load_policy(base, env, seed, masks)
        return CheckedPolicy(Masked(policy, env.world, masks), None, name)
    kind = kind_of(name)
    if kind is Kind.named:
        return CheckedPolicy(resolve_name(POLICIES[name].make)(env, seed), None, name)
    if kind is Kind.own:
        make = import_function(name, "policy", "env", "seed")
        with name_in_errors(f"policy: {name} fails"):
            policy = make(env, seed)
        if not callable(policy):
            allowed = "a function of a tensordict"
            raise ConfigError(f"policy: {name} returns {describe(policy)}; allowed: {allowed}")
        return CheckedPolicy(policy, None, name, own_actions=len(env.world.actions))
    file = Path(name.removeprefix(TRUSTED))
    if kind is Kind.onnx:
        return CheckedPolicy(*onnx_policy(file, env), name)
    if kind is Kind.sb3:
        return CheckedPolicy(*sb3_policy(file, env), name, own_actions=len(env.world.actions))
    if kind is Kind.bundled:
        file = find(name, None if ":" in name else env.suite).file
    network = load_network(file, env)
    look = Look(network.config, network.colour)
    observe = env.observer(*look[:2])
    if network.mask is None:
        return CheckedPolicy(greedy_policy(network, observe), look, name)
    if network.mask not in (*MASKS, *laid):
        # A file must not say what is imported.
        told = f"{name} was trained under the mask {network.mask}, whose code runs if you name it"
        raise ConfigError(f"policy: {told}; allowed: {name}+{network.mask}")
    from ship_trl.policies.masks import load_mask

    mask = load_mask(network.mask, env.world)
    return CheckedPolicy(greedy_policy(network, observe, mask), None, name)


def load_network(path: Path, env: ShipEnv, key: str = "policy") -> DuelingNetwork:
    """Load the network of a safetensors file for an environment; `key` is the setting that messages name.

    Raises:
        ConfigError: the file is invalid, or its network has other actions.
    """
    look = read_look(path, key)
    make = partial(make_network, look.network, len(env.world.actions), Generator(), colour=look.colour)
    network = make()
    if look.adds_source:
        network.reused = make().requires_grad_(False)
    network.load_state_dict(dict(load_weights(path, network, key)))
    network.mask = look.mask
    return network.to(env.device)


def load_with_network(name: str, env: ShipEnv) -> tuple[Policy, DuelingNetwork]:
    """Load a policy with its network.

    Raises:
        ConfigError: as `load_policy`, or the policy has no `DuelingNetwork`.
    """
    policy = load_policy(name, env)
    network = network_of(policy)
    if network is None:
        raise ConfigError(f"policy: {name} has no network; allowed: a result folder or a safetensors file")
    return policy, network


def network_of(policy: Policy) -> DuelingNetwork | None:
    """Return the `DuelingNetwork` inside a policy, if there is one."""
    parts = policy.modules() if isinstance(policy, nn.Module) else ()
    return next((part for part in parts if isinstance(part, DuelingNetwork)), None)


def failures_first(entries: list[Entry], seed: int = 0) -> list[Entry]:
    """Return the entries, but first those of the first policy that miss the goal; single cases alone."""
    first = entries[0].policy
    if sum(entry.policy == first for entry in entries) == 1:
        return entries
    return sorted(
        entries, key=lambda entry: entry.policy != first or rollout_entry(entry, 1, seed)[2][0].goal
    )


def rollout_entry(
    entry: Entry, episodes: int | None = None, seed: int = 0
) -> tuple[ShipEnv, Policy, list[Episode]]:
    """Roll out episodes in one batch, the cases in turn; return the environment, the policy and the episodes.

    `episodes` is their number, by default each case once, or `EPISODES` if the starts are perturbed; it is
    rounded up so that each case has equally many. Where nothing is drawn, each case has one. The seed is of
    the starts and of a policy that draws.

    Raises:
        ConfigError: there is no such policy, or its file is invalid.
    """
    suite = entry.suite
    if entry.policy == recorded.NAME:
        env = make_env(suite, entry.world, max(1, len(suite.cases)))
        return env, recorded.follow_track(env), recorded.rollout_recorded(suite, entry.world)
    default = EPISODES if suite.is_drawn else 1
    count = suite.whole_rounds((entry.draws and episodes) or default)
    env, policy = make_policy(entry, draw_starts(suite, entry.world, count, seed), seed)
    return env, policy, rollout(env, policy)


def time_decision(entry: Entry, start: Tensor, seed: int = 0) -> float:
    """Return the median time (ms) in which the policy decides in one episode from a state [S].

    A network's time includes drawing its pixels. `recorded` decides nothing: NaN.
    """
    if entry.policy == recorded.NAME:
        return math.nan
    env, policy = make_policy(entry, start[None], seed)
    times: list[float] = []

    def timed(step: TensorDictBase) -> TensorDictBase:
        begin = time.perf_counter()
        acted = policy(step)
        times.append(time.perf_counter() - begin)
        return acted

    rollout(env, timed)
    return 1000 * statistics.median(times)


def make_policy(entry: Entry, starts: Tensor, seed: int) -> tuple[ShipEnv, Policy]:
    """Return an entry's policy, and the environment whose rows begin with states [N, S].

    Raises:
        ConfigError: there is no such policy, or its file is invalid.
    """
    # Networks draw their own pixels, and policies without training read only the state.
    kind, colour, vector_time = kind_of(entry.policy), entry.colour, 0.0
    if kind is Kind.network:
        look = read_look(Path(split_masks(entry.policy)[0]), "policy")
        colour, vector_time = look.colour, look.network.vector_time
    seen: dict[str, Any] = {"colour": colour, "vector_time": vector_time, "from_pixels": kind is Kind.own}
    env = make_env(entry.suite, entry.world, **seen, starts=starts)
    return env, load_policy(entry.policy, env, seed)
