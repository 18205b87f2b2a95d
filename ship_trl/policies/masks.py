"""Action masks: in training and of its network (`mask=rules`), or laid on any policy (`POLICY+rules+shield`).

A mask is made of a world, by a name or a user's function, and maps states to allowed actions. `rules` forbids
turns to port of the course at the onset while own ship meets a ship head-on, gives way or overtakes, and any
change while it must only stand on, until the other ship is near (stage 4 of `policies.metrics`). It is
released where no allowed action keeps clear of ships that hold course, in the next seconds.

`shield` is for finished policies. It takes only actions behind which a held manoeuvre reaches the goal by the
simulator's prediction, in which target ships hold course and speed; the manoeuvre found last stays among
them, so that one that is found is kept. Where there was none, the policy's own action is taken.
"""

from __future__ import annotations

from typing import Any

import torch
from tensordict import TensorDictBase
from torch import Tensor

from ship_trl.config.checks import MASKS
from ship_trl.config.errors import ConfigError
from ship_trl.config.imports import import_function, name_in_errors
from ship_trl.config.types import World
from ship_trl.learn.masks import Mask
from ship_trl.learn.rollout import Policy
from ship_trl.policies.checked import describe
from ship_trl.policies.manoeuvres import Manoeuvres
from ship_trl.policies.registry import SHIELD
from ship_trl.sim.encounter import keeps_clear, stands_on, turn_since_onset
from ship_trl.sim.rules import COLLISION, STAGE4
from ship_trl.sim.state import SHIP_CLASS, STEP, relative_positions, target_ships

# How much a rate of turn counts beside a speed, where a policy has no values: 0.1 rad/s as 10 m/s.
TURN_WEIGHT = 100.0
# Radians of rounding.
LEAST_TURN = 1e-3
# Seconds that an allowed action must keep clear.
AHEAD = 10.0


def load_mask(name: str, world: World) -> Mask:
    """Make a mask by its name, or by a user's function of the world; where it forbids all, all are allowed.

    Raises:
        ConfigError: there is no such function, or it fails; later, the mask does, or returns another thing.
    """
    make = import_function(MASKS.get(name, name), "mask", "world")
    with name_in_errors(f"mask: {name} fails"):
        mask = make(world)

    def allowed(state: Tensor) -> Tensor:
        with name_in_errors(f"mask: {name} fails"):
            found: Any = mask(state)
        shape = [len(state), len(world.actions)]
        if not (isinstance(found, Tensor) and found.dtype == torch.bool and [*found.shape] == shape):
            raise ConfigError(f"mask: {name} returns {describe(found)}; allowed: bool {shape}")
        return found | ~found.any(-1, keepdim=True)

    return allowed


class RulesMask:
    """Says which actions the steering rules leave: `mask(state)` maps states [N, S] to bool [N, A]."""

    def __init__(self, world: World) -> None:
        self.near, self.steps = STAGE4 * world.safe_distance / COLLISION, round(AHEAD / world.dt)
        self.turn = torch.tensor(world.actions)[:, 1] * world.dt
        self.straight = torch.arange(len(self.turn)) == world.straight_action
        self.manoeuvres = Manoeuvres(world)

    def __call__(self, state: Tensor) -> Tensor:
        """Return the allowed actions."""
        rows = state.cpu()
        kind = target_ships(rows)[..., SHIP_CLASS]
        distance = torch.linalg.vector_norm(relative_positions(rows), dim=-1)
        must_act = keeps_clear(kind).any(-1, keepdim=True)
        to_port = (self.turn > 0) & (turn_since_onset(rows)[..., None] + self.turn > LEAST_TURN)
        breaks = (keeps_clear(kind)[..., None] & to_port).any(-2)
        stays = (stands_on(kind) & (distance > self.near)).any(-1, keepdim=True) & ~must_act
        allowed = ~breaks & (~stays | self.straight)
        bound = (must_act | stays).squeeze(-1)
        is_clear = self.manoeuvres.stay_clear(rows[bound], allowed[bound], self.steps)
        allowed[bound] |= ~is_clear[:, None]
        return allowed.to(state.device)


class Masked:
    """A policy whose actions are restricted: it reads `state` [N, S] and writes `action`.

    Its first wish is the policy's action; then come others by `action_value`, or by likeness to that action.

    Args:
        policy: writes `action`, and perhaps `action_value` [N, A].
        world: its actions and physics.
        masks: names, as `registry.split_masks` returns them.
    """

    def __init__(self, policy: Policy, world: World, masks: tuple[str, ...]) -> None:
        self.policy, self.actions = policy, torch.tensor(world.actions)
        self.masks = [load_mask(name, world) for name in masks if name != SHIELD]
        self.is_shielded = SHIELD in masks
        self.manoeuvres = Manoeuvres(world)
        self.plans = torch.empty(0, 3, dtype=torch.int64)

    def __call__(self, step: TensorDictBase) -> TensorDictBase:
        """Write `action` for the states of a batch."""
        state, step = step["state"], self.policy(step)
        own = step["action"]
        if len(self.plans) != len(state):
            self.plans = torch.full((len(state), 3), -1)
        plans = self.plans.masked_fill(state[:, STEP, None] == 0, -1)
        value = step.get("action_value", None)
        if value is None:
            apart = (self.actions - self.actions[own][:, None]).abs()
            value = -(apart[..., 0] + TURN_WEIGHT * apart[..., 1])
        value = value.double().scatter(-1, own[:, None], torch.inf)
        allowed = torch.ones_like(value, dtype=torch.bool)
        for mask in self.masks:
            allowed &= mask(state)
        # The allowed ones first, each group by value.
        order = value.argsort(dim=-1, descending=True, stable=True)
        order = order.gather(
            -1, allowed.gather(-1, order).logical_not().to(torch.int8).argsort(dim=-1, stable=True)
        )
        if self.is_shielded:
            chosen, self.plans = self.manoeuvres.choose(state, order, plans)
            return step.set("action", torch.where(chosen < 0, own, chosen))
        return step.set("action", order[:, 0])
