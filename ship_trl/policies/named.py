"""Policies without training, and loading a policy of any kind by name.

A policy reads the environment's tensordict (`state` and `pixels`) and writes `action`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path

import torch
from tensordict import TensorDictBase
from torch import Generator, nn

from ship_trl.config.errors import ConfigError
from ship_trl.config.imports import import_function
from ship_trl.learn.network import DuelingNetwork, make_network
from ship_trl.learn.policy import greedy_policy
from ship_trl.learn.rollout import Policy
from ship_trl.policies.apf import apf
from ship_trl.policies.pretrained import find, is_pretrained
from ship_trl.policies.reference import best_known
from ship_trl.policies.sb_mpc import sb_mpc
from ship_trl.policies.vo import vo
from ship_trl.sim.env import ShipEnv
from ship_trl.sim.starts import Starts
from ship_trl.sim.state import STEP
from ship_trl.transfer.layers import has_reused, load_weights, read_look


def random_actions(env: ShipEnv, seed: int = 0) -> Policy:
    """Return the policy that draws its actions uniformly."""
    generator = Generator(device=env.device).manual_seed(seed)
    count = len(env.world.actions)

    def policy(step: TensorDictBase) -> TensorDictBase:
        action = torch.randint(count, env.batch_size, generator=generator, device=env.device)
        return step.set("action", action)

    return policy


def keep_course(env: ShipEnv, _: int = 0) -> Policy:
    """Return the policy that keeps its course."""
    return follow([env.world.straight_action])


def follow_best_known(env: ShipEnv, _: int = 0) -> Policy:
    """Return the policy that follows the planner's best plan of each case.

    Raises:
        ConfigError: the starts are drawn.
    """
    if env.suite.is_drawn:
        raise ConfigError("policy: best_known has no plan of a drawn start; allowed: cases, not perturbed")
    plans = [best_known(case, env.world).actions or [0] for case in env.suite.cases]
    if len(plans) == 1:
        return follow(plans[0])
    length = max(map(len, plans))
    # A plan repeats its last action.
    table = torch.tensor([plan + plan[-1:] * (length - len(plan)) for plan in plans], device=env.device)
    starts = Starts(env.suite, env.world).states.to(env.device)
    case = torch.zeros(env.batch_size, dtype=torch.int64, device=env.device)

    def policy(step: TensorDictBase) -> TensorDictBase:
        # The plan of the case that a row has begun with.
        state = step["state"]
        time = state[:, STEP].long()
        begun = (time == 0).nonzero()[:, 0]
        if len(begun):
            matches = (state[begun, None] == starts).all(-1)
            case[begun] = torch.where(matches.any(-1), matches.to(torch.int8).argmax(-1), case[begun])
        return step.set("action", table[case, time.clamp(max=length - 1)])

    return policy


def follow(actions: Sequence[int]) -> Policy:
    """Return the policy that follows a plan, and repeats its last action."""
    plan = torch.tensor(actions or [0])

    def policy(step: TensorDictBase) -> TensorDictBase:
        time = step["state"][..., STEP].long().clamp(max=len(plan) - 1)
        return step.set("action", plan.to(time.device)[time])

    return policy


# Policies by their name on the command line.
POLICIES: dict[str, Callable[[ShipEnv, int], Policy]] = {
    "random": random_actions,
    "keep_course": keep_course,
    "best_known": follow_best_known,
    "vo": vo,
    "sb_mpc": sb_mpc,
    "apf": apf,
}
ALLOWED = f"{', '.join(POLICIES)}, pretrained, a safetensors file, or file.py:function"


def load_policy(name: str, env: ShipEnv, seed: int = 0) -> Policy:
    """Load a policy for an environment.

    Args:
        name: a key of `POLICIES`; `pretrained` (the bundled network for the environment's case or suite) or
            `pretrained:NAME`; a safetensors file; `file.py:function` or `module:function`, which is called
            with the environment and the seed.
        env: where it will act.
        seed: of its random numbers.

    Raises:
        ConfigError: there is no such policy, or its file is invalid; later, it writes an invalid action.
    """
    if name in POLICIES:
        return POLICIES[name](env, seed)
    if is_pretrained(name):
        name = str(find(name, None if ":" in name else env.suite).file)
    if Path(name).suffix == ".safetensors":
        network = load_network(Path(name), env)
        return greedy_policy(network, env.observer(network.config, network.colour))
    if ":" not in name:
        raise ConfigError(f"policy: no {name}; allowed: {ALLOWED}")
    return refusing_invalid_actions(import_function(name, "policy")(env, seed), name, env)


def load_network(path: Path, env: ShipEnv, key: str = "policy") -> DuelingNetwork:
    """Load the network of a safetensors file for an environment; `key` is the setting that messages name.

    Raises:
        ConfigError: the file is invalid, or its network has other actions.
    """
    config, colour = read_look(path, key)
    make = partial(make_network, config, len(env.world.actions), Generator(), colour=colour)
    network = make()
    if has_reused(path, key):
        network.reused = make().requires_grad_(False)
    network.load_state_dict(dict(load_weights(path, network, key)))
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


def refusing_invalid_actions(policy: object, name: str, env: ShipEnv) -> Policy:
    """Wrap a user's policy so that an invalid action raises a `ConfigError`."""
    if not callable(policy):
        raise ConfigError(f"policy: {name} returns {policy!r:.40}; allowed: a function of a tensordict")

    def check(step: object) -> None:
        action = step.get("action", None) if isinstance(step, TensorDictBase) else None
        if not isinstance(action, torch.Tensor):
            raise ConfigError(f"policy: {name} must return its tensordict with `action` in it")
        last = len(env.world.actions) - 1
        has_shape = action.dtype == torch.int64 and action.shape == env.batch_size
        if not (has_shape and bool(((action >= 0) & (action <= last)).all())):
            kind = f"{str(action.dtype).removeprefix('torch.')} {list(action.shape)}"
            got = f"{action.tolist()!s:.60}" if has_shape else kind
            allowed = f"int64 {list(env.batch_size)} from 0 to {last}"
            raise ConfigError(f"policy: {name} writes action {got}; allowed: {allowed}")

    if isinstance(policy, nn.Module):
        policy.register_forward_hook(lambda _module, _given, step: check(step))
        return policy

    def act(step: TensorDictBase) -> TensorDictBase:
        written: TensorDictBase = policy(step)
        check(written)
        return written

    return act
