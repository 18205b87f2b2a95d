"""Masks on policies: the steering rules, and the shield."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import pytest
import torch
from tensordict import TensorDict, TensorDictBase

import ship_trl
from ship_trl.config.errors import ConfigError
from ship_trl.fast.worlds import draw_starts, make_env
from ship_trl.foreign.suites import load_suite
from ship_trl.learn.rollout import Policy, rollout
from ship_trl.policies.manoeuvres import Manoeuvres
from ship_trl.policies.masks import Masked, RulesMask
from ship_trl.policies.named import load_policy
from ship_trl.policies.registry import split_masks
from ship_trl.run.entries import find_entries
from ship_trl.sim.cases import Case, TargetShip, load_world
from ship_trl.sim.encounter import Tracker
from ship_trl.sim.state import STEP, initial_state, target_ships
from tests.command import ship_trl as run

WORLD = load_world()
PORT, STRAIGHT, STARBOARD = (0, 1, 2), (3,), (4, 5, 6)
ALL = (*PORT, *STRAIGHT, *STARBOARD)


def state_of(*ships: TargetShip) -> torch.Tensor:
    state = initial_state(Case([0, 0], 90, [0, 600], "straight", [*ships], "own"), WORLD)[None]
    return Tracker(WORLD)(state, state)


def allowed(*ships: TargetShip) -> tuple[int, ...]:
    return tuple(RulesMask(WORLD)(state_of(*ships))[0].nonzero().flatten().tolist())


HEAD_ON, FROM_STARBOARD = TargetShip(0, 600, -90, 10), TargetShip(300, 300, 180, 15)
FROM_PORT, OVERTAKEN = TargetShip(-300, 300, 0, 15), TargetShip(0, 150, 90, 7)


@pytest.mark.parametrize(
    ("ships", "left"),
    [
        ((), ALL),
        ((HEAD_ON,), (*STRAIGHT, *STARBOARD)),
        ((FROM_STARBOARD,), (*STRAIGHT, *STARBOARD)),
        ((OVERTAKEN,), (*STRAIGHT, *STARBOARD)),
        ((FROM_PORT,), STRAIGHT),
        # Keeping clear comes before standing on.
        ((FROM_PORT, FROM_STARBOARD), (*STRAIGHT, *STARBOARD)),
        # Stage 4: the other ship is near and has not acted.
        ((TargetShip(-60, 60, 0, 15),), ALL),
        # It passes far away.
        ((replace(FROM_PORT, y=900.0),), ALL),
    ],
)
def test_the_rules_leave_these_actions(ships: tuple[TargetShip, ...], left: tuple[int, ...]) -> None:
    assert allowed(*ships) == left


def test_a_class_is_kept_until_the_ships_are_past_and_clear() -> None:
    mask, state = RulesMask(WORLD), state_of(FROM_STARBOARD)
    assert not mask(state)[0, 0]
    # The bow now points far behind the other ship's stern, but it has not passed.
    turned = state.clone()
    turned[0, 2] = math.radians(20)
    turned[0, STEP] = 5
    turned = Tracker(WORLD)(state, turned)
    assert not mask(turned)[0, 0]
    past = turned.clone()
    target_ships(past)[0, 0, :2] = torch.tensor([-400.0, 100.0])
    past[0, STEP] = 40
    assert bool(mask(Tracker(WORLD)(turned, past)).all())


def always(action: int) -> Policy:
    def policy(step: TensorDictBase) -> TensorDictBase:
        return step.set("action", torch.full((len(step["state"]),), action))

    return policy


def act(policy: Policy, state: torch.Tensor) -> int:
    return int(policy(TensorDict({"state": state}, [len(state)]))["action"])


def test_a_forbidden_action_becomes_the_likest_allowed_one() -> None:
    for wanted, taken in ((0, 4), (2, 4), (5, 5)):
        assert act(Masked(always(wanted), WORLD, ("rules",)), state_of(HEAD_ON)) == taken


def test_the_rules_are_released_where_only_a_forbidden_action_leads_to_the_goal() -> None:
    suite = load_suite("traffic_dense", WORLD)
    env = make_env(suite, WORLD, starts=draw_starts(suite, WORLD, 40, 5000))
    manoeuvres, found = Manoeuvres(WORLD), set()
    ways = [*rollout(env, load_policy("keep_course", env)), *rollout(env, load_policy("manoeuvre", env))[:9]]
    for episode in ways:
        mask, masked = RulesMask(WORLD), Masked(always(0), WORLD, ("rules",))
        for state in episode.states[:-1, None].unbind(0):
            allowed, taken = mask(state)[0], act(masked, state)
            each = torch.arange(7)[:, None].expand(7, 7).contiguous()
            leads = manoeuvres.choose(state.repeat(7, 1), each, torch.full((7, 3), -1))[0] >= 0
            is_released = not bool((leads & allowed).any()) and bool(leads.any())
            assert (taken == 0) if is_released or allowed[0] else bool(allowed[taken])
            found.add((is_released, bool(allowed[0])))
    assert found >= {(True, False), (False, False), (False, True)}


def test_a_shielded_policy_solves_what_a_manoeuvre_solves() -> None:
    suite = load_suite("traffic_dense", WORLD)
    env = make_env(suite, WORLD, starts=draw_starts(suite, WORLD, 40, 3000))
    for name in ("random", "keep_course"):
        bare, shielded = (rollout(env, load_policy(name + more, env)) for more in ("", "+shield"))
        assert sum(one.goal for one in bare) < 10
        assert all(one.goal for one in shielded)


def test_a_shield_expects_that_ships_may_give_way() -> None:
    suite = load_suite("traffic_reacting", WORLD)
    env = make_env(suite, WORLD, starts=draw_starts(suite, WORLD, 60, 3000))
    bare, shielded = (rollout(env, load_policy("pretrained:traffic" + more, env)) for more in ("", "+shield"))
    assert sum(one.goal for one in bare) < 58 < sum(one.goal for one in shielded)


def test_a_shield_leaves_alone_what_leads_to_the_goal() -> None:
    suite = load_suite("traffic", WORLD)
    env = make_env(suite, WORLD, starts=draw_starts(suite, WORLD, 30, 60))
    bare = rollout(env, load_policy("manoeuvre_rules", env))
    shielded = rollout(env, load_policy("manoeuvre_rules+shield", env))
    same = [a.actions.tolist() == b.actions.tolist() for a, b in zip(bare, shielded, strict=True)]
    # Others would come too near to a ship that gives way.
    assert sum(same) > 20


def test_masks_are_the_last_words_of_a_policy() -> None:
    assert split_masks("vo+rules+shield") == ("vo", ("rules", "shield"))
    assert split_masks("a+b.safetensors") == ("a+b.safetensors", ())
    with pytest.raises(ConfigError, match="shield is given twice"):
        split_masks("vo+shield+shield")
    (entry,) = find_entries(["pretrained:4+shield"], colour=False)
    assert entry.label == "pretrained:4+shield" and entry.claimed is None


def test_it_acts_by_the_scene_in_gymnasium() -> None:
    policy = ship_trl.load_policy("traffic+shield")
    assert policy.observation == "state"
    action, _ = policy.predict(state_of(HEAD_ON)[0].numpy())
    assert action.shape == () and 0 <= int(action) < len(WORLD.actions)


def test_the_command_takes_them(tmp_path: Path) -> None:
    said = run("vo+shield", "pretrained:3+rules", "target=3", folder=tmp_path, verb="evaluate").stdout
    assert "vo+shield" in said and "pretrained:3+rules" in said
    refused = run("vo+armour", "target=3", folder=tmp_path, verb="evaluate", code=1).stderr
    assert refused.startswith("ship_trl: policy: no vo+armour; allowed: ") and refused.count("\n") == 1
