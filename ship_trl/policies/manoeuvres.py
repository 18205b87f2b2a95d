"""Held manoeuvres: an action for some steps, straight on for some, then a course for the goal.

The generator of random encounters keeps only scenes that one of these solves, if target ships hold their
course (`sim.starts`). So policy `manoeuvre`, which follows the best of them, solves all these scenes by
construction: it is a bar for other policies, not a finding.
"""

from __future__ import annotations

from itertools import product
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from tensordict import TensorDictBase
from torch import Tensor

from ship_trl.config.types import World
from ship_trl.fast.manoeuvres import choose_actions, stay_clear
from ship_trl.fast.step import constants
from ship_trl.sim.cases import HOLDS_COURSE
from ship_trl.sim.env import ShipEnv
from ship_trl.sim.reward import POSITION_TOLERANCE
from ship_trl.sim.starts import HOLD, STRAIGHT
from ship_trl.sim.state import SHIP_BEHAVIOUR, STEP, goal_off_bow, target_ships
from ship_trl.sim.transition import Transition

Array = NDArray[Any]


def manoeuvre_table(world: World) -> Array:
    """Return all manoeuvres, int64 [P, 3]: an action, steps that it is held, and steps straight on after it.

    The first one steers for the goal at once.
    """
    straight = world.straight_action
    evading = [k for k in range(len(world.actions)) if k != straight]
    return np.array(
        [(straight, 0, 0), *((a, h, s) for s, h, a in product(STRAIGHT, HOLD, evading))], np.int64
    )


class Manoeuvres:
    """The manoeuvres of a world, and what they lead to if target ships hold course and speed."""

    def __init__(self, world: World) -> None:
        self.world, self.table = world, manoeuvre_table(world)
        self.actions, numbers = np.array(world.actions, np.float64), constants(world).astype(np.float64)
        # Float32 states may differ from these float64 ones.
        numbers[1] += POSITION_TOLERANCE
        self.model = self.table, self.actions, numbers, world.straight_action

    def follow(self, state: Tensor, plans: Tensor) -> tuple[Tensor, Tensor]:
        """Return the first actions [N] of plans [N, 3] in states [N, S], and what is left of the plans."""
        action, hold, straight = plans.unbind(-1)
        turns = torch.tensor(self.actions[:, 1] * self.world.dt, dtype=state.dtype, device=state.device)
        steering = (goal_off_bow(state)[:, None] - turns).abs().argmin(-1)
        chosen = torch.where(straight > 0, self.world.straight_action, steering)
        chosen = torch.where(hold > 0, action, chosen)
        left = torch.stack(
            (action, (hold - 1).clamp(min=0), torch.where(hold > 0, straight, straight - 1)), -1
        )
        return chosen, left.clamp(min=0)

    def choose(self, state: Tensor, order: Tensor, plans: Tensor) -> tuple[Tensor, Tensor]:
        """Return for each row the first action with which a way to the goal begins, or -1; and its rest.

        Args:
            state: states [N, S].
            order: actions, the wanted ones first, int64 [N, A].
            plans: of each row the manoeuvre found last, int64 [N, 3], -1 without one. It is tried before the
                others, and goes on where none is found: by rounding it may pass or arrive too late.
        """
        chosen, found = np.empty(len(state), np.int64), plans.numpy().copy()
        choose_actions(state.double().numpy(), order.numpy(), self.model, found, chosen)
        return torch.from_numpy(chosen), torch.from_numpy(found)

    def stay_clear(self, state: Tensor, allowed: Tensor, steps: int) -> Tensor:
        """Return where a manoeuvre behind an allowed action, bool [N, A], stays clear for some steps: [N]."""
        found = np.empty(len(state), np.bool_)
        stay_clear(state.double().numpy(), allowed.numpy(), self.model, steps, found)
        return torch.from_numpy(found)


class BestManoeuvre:
    """Follows, of all manoeuvres from the start, the one with the highest return or the best rule scores.

    It is chosen once, at step 0, as if target ships held course.

    Args:
        env: where it acts.
        by_rules: whether the mean rule score counts first; only manoeuvres that reach the goal then count.
    """

    def __init__(self, env: ShipEnv, _: int = 0, *, by_rules: bool = False) -> None:
        self.manoeuvres, self.by_rules = Manoeuvres(env.world), by_rules
        self.plans = torch.empty(0, 3, dtype=torch.int64)

    def __call__(self, step: TensorDictBase) -> TensorDictBase:
        """Write `action` for the states of a batch."""
        state = step["state"]
        if len(self.plans) != len(state):
            self.plans = torch.zeros(len(state), 3, dtype=torch.int64)
        for n in (state[:, STEP] == 0).nonzero().squeeze(-1).tolist():
            self.plans[n] = self.best(state[n])
        action, self.plans = self.manoeuvres.follow(state, self.plans)
        return step.set("action", action)

    def best(self, start: Tensor) -> Tensor:
        """Return the best manoeuvre [3] from a state [S]."""
        world, plans = self.manoeuvres.world, torch.from_numpy(self.manoeuvres.table)
        transition, state = Transition(world), start.repeat(len(plans), 1)
        target_ships(state)[..., SHIP_BEHAVIOUR] = HOLDS_COURSE
        table, states = plans, [state]
        total, running = torch.zeros(len(plans)), torch.ones(len(plans), dtype=torch.bool)
        arrives, last = torch.zeros_like(running), torch.zeros(len(plans), dtype=torch.int64)
        while bool(running.any()):
            action, plans = self.manoeuvres.follow(state, plans)
            after = transition(state, action)
            total += after.reward * running
            last += running
            arrives |= running & after.goal
            running = running & ~(after.goal | after.collision | after.truncated)
            state = after.state
            states.append(state)
        worth = total.double()
        if self.by_rules:
            from ship_trl.policies.metrics import score_rules

            scores = score_rules(torch.stack(states, 1), last, world).rules.flatten(1).nanmean(-1)
            # A return is at most some hundred points.
            worth = worth + 1e4 * scores.nan_to_num(1.0) + 1e6 * arrives
        return table[int(worth.argmax())]


def best_rules(env: ShipEnv, _: int = 0) -> BestManoeuvre:
    """Return the policy that follows the manoeuvre with the best rule scores of those that arrive."""
    return BestManoeuvre(env, by_rules=True)
