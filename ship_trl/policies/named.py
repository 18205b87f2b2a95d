"""Policies without training, and loading a policy of any kind by name.

A policy reads the environment's tensordict (`state` and `pixels`) and writes `action`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path

import torch
from tensordict import TensorDictBase
from tensordict.nn import TensorDictModuleBase
from torch import Generator, nn

from ship_trl.config.errors import ConfigError
from ship_trl.config.imports import import_function, name_in_errors
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
from ship_trl.sim.state import OWN_SIZE, SHIP_SIZE, STEP
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


def check_name(name: str, more: Sequence[str] = ()) -> None:
    """Refuse what names no policy; `more` are names that are allowed too.

    Raises:
        ConfigError: there is no such policy, or its file is no safetensors file of ours.
    """
    if Path(name).suffix == ".safetensors":
        read_look(Path(name), "policy")
    elif name not in POLICIES and not is_pretrained(name) and ":" not in name:
        raise ConfigError(f"policy: no {name}; allowed: {', '.join((*more, ALLOWED))}")


def load_policy(name: str, env: ShipEnv, seed: int = 0) -> Policy:
    """Load a policy for an environment.

    Args:
        name: a key of `POLICIES`; `pretrained` (the bundled network for the environment's case or suite) or
            `pretrained:NAME`; a safetensors file; `file.py:function` or `module:function`, which is called
            with the environment and the seed.
        env: where it will act.
        seed: of its random numbers.

    Raises:
        ConfigError: there is no such policy, or its file is invalid; later, it is called with no tensordict
            with states, or a user's fails or writes an invalid action.
    """
    check_name(name)
    if name in POLICIES:
        return CheckedPolicy(POLICIES[name](env, seed), name)
    path = Path(name)
    if is_pretrained(name):
        path = find(name, None if ":" in name else env.suite).file
    if path.suffix == ".safetensors":
        network = load_network(path, env)
        policy = greedy_policy(network, env.observer(network.config, network.colour))
        return CheckedPolicy(policy, name)
    make = import_function(name, "policy", "env", "seed")
    with name_in_errors(f"policy: {name} fails"):
        policy = make(env, seed)
    if not callable(policy):
        raise ConfigError(f"policy: {name} returns {describe(policy)}; allowed: a function of a tensordict")
    return CheckedPolicy(policy, name, env)


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


class CheckedPolicy(TensorDictModuleBase):
    """Calls a policy, and refuses what it cannot read; of a user's, errors and wrong actions too.

    Args:
        policy: reads `state`, float32 [N, S], and writes `action`.
        name: its name in messages.
        env: where a user's policy acts; None for one of ours.
    """

    def __init__(self, policy: Policy, name: str, env: ShipEnv | None = None) -> None:
        super().__init__()
        self.policy, self.name = policy, name
        self.in_keys, self.out_keys = ["state"], ["action"]
        self.limits = None if env is None else (env.batch_size, len(env.world.actions) - 1)

    def forward(self, tensordict: TensorDictBase) -> TensorDictBase:
        """Write `action` into a tensordict.

        Raises:
            ConfigError: it has no states, or a user's policy fails or writes an invalid action.
        """
        state = tensordict.get("state", None) if isinstance(tensordict, TensorDictBase) else None
        if not isinstance(state, torch.Tensor):
            allowed, got = "a tensordict with `state`, as ShipEnv returns it", describe(tensordict)
            raise ConfigError(f"policy: {self.name} is called with {got}; allowed: {allowed}")
        numbers = (state.shape or (0,))[-1] - OWN_SIZE
        if state.dtype != torch.float32 or numbers < 0 or numbers % SHIP_SIZE:
            allowed = f"float32 [N, {OWN_SIZE} + {SHIP_SIZE} a ship], see sim/state.py"
            raise ConfigError(f"policy: {self.name} is given state {describe(state)}; allowed: {allowed}")
        if self.limits is None:
            return self.policy(tensordict)
        with name_in_errors(f"policy: {self.name} fails"):
            written = self.policy(tensordict)
        self._check_action(written, *self.limits)
        return written

    def _check_action(self, step: object, batch_size: torch.Size, last: int) -> None:
        action = step.get("action", None) if isinstance(step, TensorDictBase) else None
        if not isinstance(action, torch.Tensor):
            raise ConfigError(f"policy: {self.name} must return its tensordict with `action` in it")
        has_shape = action.dtype == torch.int64 and action.shape == batch_size
        if not (has_shape and bool(((action >= 0) & (action <= last)).all())):
            got = f"{action.tolist()!s:.60}" if has_shape else describe(action)
            allowed = f"int64 {list(batch_size)} from 0 to {last}"
            raise ConfigError(f"policy: {self.name} writes action {got}; allowed: {allowed}")


def describe(value: object) -> str:
    """Describe a wrong value in a few words: kind and shape of an array, keys of a tensordict."""
    if isinstance(value, TensorDictBase):
        return f"a tensordict with {', '.join(sorted(map(str, value.keys()))) or 'nothing'}"
    if hasattr(value, "dtype") and hasattr(value, "shape"):
        return f"{str(value.dtype).removeprefix('torch.')} {list(value.shape)}"
    return f"{value!r:.40}"
