"""What steps earn by the steering rules, and what is remembered of an encounter."""

from __future__ import annotations

import math

import pytest
import torch
from torch import Tensor

from ship_trl.config.types import Margin
from ship_trl.fast.worlds import draw_starts, make_env
from ship_trl.learn.rollout import rollout
from ship_trl.policies.metrics import measure_episodes
from ship_trl.policies.named import load_policy
from ship_trl.sim.cases import Case, TargetShip, load_suite, load_world, suite_of
from ship_trl.sim.encounter import Encounter, relative_motion
from ship_trl.sim.rules import PASS, rule_payment
from ship_trl.sim.state import (
    SHIP_ACTION,
    SHIP_CLASS,
    SHIP_COUNT,
    SHIP_ONSET,
    SHIP_ONSET_HEADING,
    SHIP_SIZE,
    STEP,
    target_ships,
)

WORLD = load_world()
PORT, STRAIGHT, STARBOARD = 0, 3, 6
HEAD_ON, FROM_STARBOARD = TargetShip(0, 500, -90, 10), TargetShip(300, 300, 180, 15)
FROM_PORT, OVERTAKEN = TargetShip(-300, 300, 0, 15), TargetShip(0, 200, 90, 5)
# Faster than own ship in a hard turn.
FAST_AHEAD = TargetShip(0, 140, 90, 10)


def run(ship: TargetShip, actions: list[int]) -> Tensor:
    """Return the states [T + 1, S] of own ship's actions towards a ship."""
    case = Case([0, 0], 90, [0, 600], "straight", [ship], "own")
    env = make_env(suite_of(case), WORLD, 1)
    step = env.reset()
    states = [step["state"]]
    for action in actions:
        stepped, step = env.step_and_maybe_reset(step.set("action", torch.tensor([action])))
        states.append(stepped["next", "state"])
        if bool(stepped["next", "done"]):
            break
    return torch.cat(states)


def payments(states: Tensor) -> Tensor:
    return rule_payment(states[:-1], states[1:], WORLD)


@pytest.mark.parametrize(
    ("ship", "kind"),
    [
        (HEAD_ON, Encounter.HEAD_ON),
        (FROM_STARBOARD, Encounter.GIVE_WAY),
        (FROM_PORT, Encounter.STAND_ON),
        (OVERTAKEN, Encounter.OVERTAKING),
        (TargetShip(400, 0, 90, 10), Encounter.NONE),
    ],
)
def test_a_state_remembers_the_class_and_the_onset(ship: TargetShip, kind: Encounter) -> None:
    states = run(ship, [STARBOARD] * 3 + [STRAIGHT] * 3)
    ships = target_ships(states)[:, 0]
    assert set(ships[:, SHIP_CLASS].tolist()) == {float(kind)}
    assert states[:, STEP].tolist() == [0, 1, 2, 3, 4, 5, 6]
    onset, heading = (0.0, math.pi / 2) if kind != Encounter.NONE else (0.0, 0.0)
    assert set(ships[:, SHIP_ONSET].tolist()) == {onset}
    assert ships[:, SHIP_ONSET_HEADING].tolist() == pytest.approx([heading] * 7)


def test_an_encounter_ends_where_the_ship_is_past_and_clear() -> None:
    # A turn away opens the range, but on its old course own ship would still overtake.
    away = run(FAST_AHEAD, [STARBOARD] * 8 + [STRAIGHT] * 10)
    motion = relative_motion(away)
    apart = (motion.tcpa[:, 0] < 0) & (motion.distance[:, 0] > 2 * WORLD.safe_distance)
    assert apart[1:].all()
    assert set(target_ships(away)[:, 0, SHIP_CLASS].tolist()) == {float(Encounter.OVERTAKING)}
    # It goes by on a course beside the old one.
    passing = run(TargetShip(0, 200, 90, 5), [STARBOARD] * 8 + [PORT] * 8 + [STRAIGHT] * 30)
    classes = target_ships(passing)[:, 0, SHIP_CLASS]
    over = int((classes == Encounter.NONE).int().argmax())
    motion = relative_motion(passing)
    assert over > 20 and not classes[over:].any() and bool((classes[:over] > 0).all())
    assert motion.bearing[over, 0].abs() > math.pi / 2 and motion.distance[over, 0] > 2 * WORLD.safe_distance


def test_an_action_grows_with_the_turn_and_is_kept() -> None:
    turns = [STARBOARD] * 6 + [STRAIGHT] * 4
    action = target_ships(run(HEAD_ON, turns))[:, 0, SHIP_ACTION]
    # Half for the speed, which is halved at once, and half for 34 degrees.
    assert action[1] == pytest.approx(0.5 + 0.5 * ((math.degrees(0.1) - 2) / 28) ** 2, abs=1e-4)
    assert action[6:].tolist() == [1.0] * 5
    # A turn to port is no action towards a ship that is met head-on.
    port = target_ships(run(HEAD_ON, [PORT] * 6))[:, 0, SHIP_ACTION]
    assert port.max() == 0.5


def test_keeping_clear_early_and_to_starboard_earns_most() -> None:
    def total(ship: TargetShip, *actions: tuple[int, int]) -> float:
        return float(payments(run(ship, [a for a, times in actions for _ in range(times)])).sum())

    for ship in (HEAD_ON, FROM_STARBOARD):
        early = total(ship, (STARBOARD, 8), (STRAIGHT, 25))
        late = total(ship, (STRAIGHT, 10), (STARBOARD, 8), (STRAIGHT, 15))
        port = total(ship, (PORT, 8), (STRAIGHT, 25))
        assert early > max(late, port) + 0.1
    assert total(FROM_PORT, (STRAIGHT, 10)) == 0
    assert total(FROM_PORT, (STARBOARD, 8)) == pytest.approx(-1.0)
    # Overtaking has no side.
    sides = [total(OVERTAKEN, (side, 8), (STRAIGHT, 25)) for side in (PORT, STARBOARD)]
    assert sides[0] == pytest.approx(sides[1], abs=1e-3)


def test_a_turn_to_port_costs_until_own_ship_has_acted_to_starboard() -> None:
    # From the course at the onset, 5.7 degrees to port and back.
    paid = payments(run(FROM_STARBOARD, [PORT, STARBOARD]))
    slowing = 0.5 * min(math.dist((0, 0), (300, 300)) / 236, 1)
    assert paid.tolist() == pytest.approx([slowing - (math.degrees(0.1) - 2) / 28, 0.0], abs=1e-4)
    # After an action in full, the way back past that course costs nothing.
    assert payments(run(FROM_STARBOARD, [STARBOARD] * 6 + [PORT] * 8))[6:].tolist() == [0.0] * 8
    # An encounter that ends leaves no course to turn from.
    states = run(TargetShip(-40, 500, -90, 10), [5] * 12 + [STRAIGHT] * 40)
    ends = (target_ships(states)[:-1, 0, SHIP_CLASS] != target_ships(states)[1:, 0, SHIP_CLASS]).nonzero()
    # What is left is the cost of the pass.
    assert len(ends) and bool((payments(states)[ends] > -0.1).all())


def test_an_action_is_paid_while_own_ship_would_still_come_nearer_on_its_old_course() -> None:
    states = run(FAST_AHEAD, [STARBOARD] * 6)
    grows = target_ships(states)[:, 0, SHIP_ACTION].diff() > 0
    apart = relative_motion(states).tcpa[:-1, 0] < 0
    assert bool((grows & apart).any()) and bool((payments(states)[grows & apart] > 0).all())


@pytest.mark.parametrize("ship", [HEAD_ON, FROM_PORT])
def test_a_collision_costs_a_pass_without_safety_whoever_keeps_clear(ship: TargetShip) -> None:
    states = run(ship, [STRAIGHT] * 40)
    paid = payments(states)
    assert paid[-1] == pytest.approx(-PASS) and not paid[:-1].any()
    # It is no mean over ships, and empty places, which lie at the origin as own ship does at first, are none.
    padded = torch.cat((states, torch.zeros(len(states), SHIP_SIZE)), -1)
    assert torch.equal(payments(padded), paid)
    far = padded.clone()
    far[:, SHIP_COUNT] = 2
    target_ships(far)[:, 1, :2] = 5000.0
    assert payments(far)[-1] == pytest.approx(-PASS)


def test_without_ships_nothing_is_paid() -> None:
    states = torch.zeros(3, 9)
    assert rule_payment(states, states, WORLD).tolist() == [0, 0, 0]


def test_training_alone_pays_for_the_rules() -> None:
    suite = load_suite("traffic_test", WORLD)
    starts = draw_starts(suite, WORLD, 60, 0)
    plain, paid = (
        make_env(suite, WORLD, starts=starts, margin=Margin(rules=weight)) for weight in (0.0, 10.0)
    )
    obeying, careless = (load_policy(name, plain) for name in ("manoeuvre_rules", "manoeuvre"))
    earned = []
    for policy in (obeying, careless):
        bare, more = rollout(plain, policy), rollout(paid, policy)
        assert all(torch.equal(a.states, b.states) for a, b in zip(bare, more, strict=True))
        extra = [a.episode_return - b.episode_return for a, b in zip(more, bare, strict=True)]
        wanted = [10 * float(payments(one.states).sum()) for one in bare]
        assert extra == pytest.approx(wanted, abs=1e-2)
        scores = measure_episodes(bare, WORLD).known("rule_8").mean()
        earned.append((sum(extra), scores))
    # Who has better scores earns more.
    assert earned[0][0] > earned[1][0] and earned[0][1] > earned[1][1]
