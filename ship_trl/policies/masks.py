"""Action masks, laid on any policy: `POLICY+rules`, `POLICY+shield`, `POLICY+rules+shield`.

`rules` forbids port turns while own ship meets a ship head-on, gives way or overtakes, and any change while
it must only stand on, until the other ship is near (stage 4 of `policies.metrics`). It is released where no
allowed action leads to the goal. `shield` takes only actions behind which a held manoeuvre reaches the goal
by the simulator's prediction, in which target ships hold course and speed; the manoeuvre found last stays
among them, so that one that is found is kept. Where there was none, the policy's own action is taken.
"""

from __future__ import annotations

import torch
from tensordict import TensorDictBase
from torch import Tensor

from ship_trl.config.types import World
from ship_trl.learn.rollout import Policy
from ship_trl.policies.manoeuvres import Manoeuvres
from ship_trl.sim.encounter import relative_motion
from ship_trl.sim.rules import COLLISION, STAGE4, keeps_clear, stands_on
from ship_trl.sim.state import SHIP_CLASS, STEP, target_ships

# How much a rate of turn counts beside a speed, where a policy has no values: 0.1 rad/s as 10 m/s.
TURN_WEIGHT = 100.0


class RulesMask:
    """Says which actions the steering rules leave: `mask(state)` maps states [N, S] to bool [N, A]."""

    def __init__(self, world: World) -> None:
        self.near = STAGE4 * world.safe_distance / COLLISION
        turn = torch.tensor(world.actions)[:, 1]
        self.to_port, self.straight = turn > 0, torch.arange(len(turn)) == world.straight_action

    def __call__(self, state: Tensor) -> Tensor:
        """Return the allowed actions."""
        kind, distance = target_ships(state)[..., SHIP_CLASS], relative_motion(state).distance
        must_act = keeps_clear(kind).any(-1, keepdim=True)
        stays = (stands_on(kind) & (distance > self.near)).any(-1, keepdim=True) & ~must_act
        return ~(must_act & self.to_port) & (~stays | self.straight)


class Masked:
    """A policy whose actions are restricted: it reads `state` [N, S] and writes `action`.

    Its first wish is the policy's action; then come others by `action_value`, or by likeness to that action.

    Args:
        policy: writes `action`, and perhaps `action_value` [N, A].
        world: its actions and physics.
        masks: names of `registry.MASKS`.
    """

    def __init__(self, policy: Policy, world: World, masks: tuple[str, ...]) -> None:
        self.policy, self.actions = policy, torch.tensor(world.actions)
        self.rules = RulesMask(world) if "rules" in masks else None
        self.is_shielded = "shield" in masks
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
        allowed = torch.ones_like(value, dtype=torch.bool) if self.rules is None else self.rules(state)
        # The allowed ones first, each group by value.
        order = value.argsort(dim=-1, descending=True, stable=True)
        order = order.gather(
            -1, allowed.gather(-1, order).logical_not().to(torch.int8).argsort(dim=-1, stable=True)
        )
        if self.is_shielded:
            chosen, self.plans = self.manoeuvres.choose(state, order, plans)
            return step.set("action", torch.where(chosen < 0, own, chosen))
        # Released where only a forbidden action leads to the goal.
        permitted = torch.where(allowed.gather(-1, order), order, order[:, :1])
        kept, any_of_all = (self.manoeuvres.choose(state, each, plans)[0] for each in (permitted, order))
        return step.set("action", torch.where((kept < 0) & (any_of_all >= 0), own, order[:, 0]))
