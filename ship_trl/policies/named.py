"""Policies that need no training, and one place that gives a policy of any kind by its name.

A policy reads a tensordict of the environment (`state`, and `pixels` where it asks for them) and writes
`action`. Whatever does that can be sailed, scored, filmed and tabled beside the others.
"""

from __future__ import annotations

import importlib
import importlib.util
import sys
from collections.abc import Callable, Sequence
from pathlib import Path

import torch
from tensordict import TensorDictBase
from torch import Generator, nn

from ship_trl.config.errors import ConfigError
from ship_trl.learn.network import DuelingNetwork
from ship_trl.learn.policy import greedy_policy
from ship_trl.learn.rollout import Policy
from ship_trl.policies.pretrained import find, is_pretrained
from ship_trl.sim.dynamics import STEP
from ship_trl.sim.env import ShipEnv
from ship_trl.sim.reference import best_known
from ship_trl.transfer.layers import load_weights, saved_network


def random_actions(env: ShipEnv, seed: int = 0) -> Policy:
    """Make the policy that draws its actions uniformly, from `seed`."""
    generator = Generator(device=env.device).manual_seed(seed)
    count = len(env.world.actions)

    def policy(step: TensorDictBase) -> TensorDictBase:
        action = torch.randint(count, env.batch_size, generator=generator, device=env.device)
        return step.set("action", action)

    return policy


def keep_course(env: ShipEnv, _: int = 0) -> Policy:
    """Make the policy that turns as little as table 1 lets it, at the highest speed of those actions."""
    actions = env.world.actions
    chosen = min(range(len(actions)), key=lambda k: (abs(actions[k][1]), -actions[k][0]))
    return follow([chosen] * env.world.max_steps)


def sail_best_known(env: ShipEnv, _: int = 0) -> Policy:
    """Make the policy that sails the planner's best plan."""
    return follow(best_known(env.case, env.world).actions)


def follow(actions: Sequence[int]) -> Policy:
    """Make the policy that sails a plan: an action for each step, and the last one from there on."""
    plan = torch.tensor(actions or [0])

    def policy(step: TensorDictBase) -> TensorDictBase:
        time = step["state"][..., STEP].long().clamp(max=len(plan) - 1)
        return step.set("action", plan.to(time.device)[time])

    return policy


# By the word that stands for them on a command line. A policy of your own is one more line here, or
# `file.py:name` there.
POLICIES: dict[str, Callable[[ShipEnv, int], Policy]] = {
    "random": random_actions,
    "keep_course": keep_course,
    "best_known": sail_best_known,
}
ALLOWED = f"{', '.join(POLICIES)}, pretrained, a safetensors file, or file.py:function"


def load_policy(name: str, env: ShipEnv, seed: int = 0) -> Policy:
    """Give the policy that a word, a file of weights or a function of one's own stands for.

    Args:
        name: a key of `POLICIES`; `pretrained`, the network that comes with us for the environment's case,
            or `pretrained:CASE`, that of another; a safetensors file; or `file.py:function` or
            `module:function`, called with the environment and the seed.
        env: where it will sail.
        seed: of what it draws.

    Raises:
        ConfigError: there is no such policy, or its file is not right; later, as it sails, an action is not.
    """
    if name in POLICIES:
        return POLICIES[name](env, seed)
    if is_pretrained(name):
        name = str(find(name, env.case).file)
    if Path(name).suffix == ".safetensors":
        channels = env.rasteriser.channels
        network = DuelingNetwork(
            channels, len(env.world.actions), Generator(), saved_network(Path(name), "policy")
        )
        network.load_state_dict(dict(load_weights(Path(name), network, "policy")))
        return greedy_policy(network.to(env.device), env.rasteriser)
    where, colon, function = name.rpartition(":")
    if not colon:
        raise ConfigError(f"policy: no {name}; allowed: {ALLOWED}")
    return checked(own(where, function, name)(env, seed), name, env)


def load_with_network(name: str, env: ShipEnv) -> tuple[Policy, DuelingNetwork]:
    """Give a policy as `load_policy` does, and the network that it sails by.

    Raises:
        ConfigError: as `load_policy`, or the policy has no network of ours.
    """
    policy = load_policy(name, env)
    network = network_of(policy)
    if network is None:
        raise ConfigError(f"policy: {name} has no network; allowed: a result folder or a safetensors file")
    return policy, network


def network_of(policy: Policy) -> DuelingNetwork | None:
    """Find the network inside a policy, None where it has none of ours."""
    parts = policy.modules() if isinstance(policy, nn.Module) else ()
    return next((part for part in parts if isinstance(part, DuelingNetwork)), None)


def checked(policy: object, name: str, env: ShipEnv) -> Policy:
    """Give somebody's own policy back, which then says in one line what is wrong with an action it writes.

    Raises:
        ConfigError: it cannot be called.
    """
    if not callable(policy):
        raise ConfigError(f"policy: {name} gives {policy!r:.40}; allowed: a function of a tensordict")

    def check(step: object) -> None:
        action = step.get("action", None) if isinstance(step, TensorDictBase) else None
        if not isinstance(action, torch.Tensor):
            raise ConfigError(f"policy: {name} must give its tensordict back, with `action` in it")
        shape, last = list(env.batch_size), len(env.world.actions) - 1
        allowed = f"int64 {shape} from 0 to {last}"
        if action.dtype != torch.int64 or action.shape != env.batch_size:
            kind = str(action.dtype).removeprefix("torch.")
            raise ConfigError(f"policy: {name} writes action {kind} {list(action.shape)}; allowed: {allowed}")
        if not bool(((action >= 0) & (action <= last)).all()):
            raise ConfigError(f"policy: {name} writes action {action.tolist()!s:.60}; allowed: {allowed}")

    if isinstance(policy, nn.Module):
        policy.register_forward_hook(lambda _module, _given, step: check(step))
        return policy

    def act(step: TensorDictBase) -> TensorDictBase:
        written: TensorDictBase = policy(step)
        check(written)
        return written

    return act


def own(where: str, function: str, name: str) -> Callable[[ShipEnv, int], Policy]:
    """Import a function of a module or of a Python file.

    Raises:
        ConfigError: it cannot be imported, or holds no such function.
    """
    try:
        if where.endswith(".py"):
            spec = importlib.util.spec_from_file_location(f"ship_trl_policy_{Path(where).stem}", where)
            assert spec is not None and spec.loader is not None
            module = importlib.util.module_from_spec(spec)
            # A name that no other module has, for dataclasses and pickles that ask for it.
            sys.modules[spec.name] = module
            spec.loader.exec_module(module)
        else:
            module = importlib.import_module(where)
    except Exception as error:  # whatever somebody's file may raise
        reason = " ".join(f"{type(error).__name__}: {error}".split())
        raise ConfigError(f"policy: {name} cannot be imported: {reason}") from None
    found = getattr(module, function, None)
    if not callable(found):
        raise ConfigError(f"policy: {where} has no function {function}")
    made: Callable[[ShipEnv, int], Policy] = found
    return made
