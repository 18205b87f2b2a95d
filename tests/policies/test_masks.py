"""Masks on policies: the steering rules, and the shield."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import pytest
import torch
from tensordict import TensorDict, TensorDictBase
from torch import Generator

import ship_trl
from ship_trl.config.errors import ConfigError
from ship_trl.config.network import load_network
from ship_trl.fast.worlds import draw_starts, make_env
from ship_trl.foreign.suites import load_suite
from ship_trl.learn.network import make_network
from ship_trl.learn.rollout import Policy, rollout
from ship_trl.policies.manoeuvres import Manoeuvres
from ship_trl.policies.masks import Masked, RulesMask, load_mask
from ship_trl.policies.named import load_policy
from ship_trl.policies.registry import split_masks
from ship_trl.run.entries import find_entries
from ship_trl.sim.cases import GIVES_WAY, HOLDS_COURSE, Case, TargetShip, load_world
from ship_trl.sim.encounter import Tracker
from ship_trl.sim.state import SHIP_BEHAVIOUR, STEP, initial_state, target_ships
from ship_trl.sim.transition import Transition
from ship_trl.transfer.weights import save_weights
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
    # The bow now points far behind the other ship's stern, but it has not passed: own ship may turn back.
    turned = state.clone()
    turned[0, 2] = math.radians(20)
    turned[0, STEP] = 5
    turned = Tracker(WORLD)(state, turned)
    assert bool(mask(turned).all())
    turned[0, 2] = math.radians(90)
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


def test_the_rules_are_released_where_no_allowed_action_keeps_clear() -> None:
    suite = load_suite("traffic_dense", WORLD)
    env = make_env(suite, WORLD, starts=draw_starts(suite, WORLD, 40, 5000))
    ways = [*rollout(env, load_policy("keep_course", env)), *rollout(env, load_policy("random", env))]
    state = torch.cat([episode.states[:-1] for episode in ways])
    mask = RulesMask(WORLD)
    found, manoeuvres, clear = mask(state), mask.manoeuvres, mask.manoeuvres.stay_clear
    mask.manoeuvres.stay_clear = lambda rows, *_: torch.ones(len(rows), dtype=torch.bool)  # type: ignore[method-assign]
    bare = mask(state)
    released = (found != bare).any(-1)
    assert bool(found[released].all()) and 0 < int(released.sum()) < len(state) / 2
    # A manoeuvre that begins with an allowed action comes too near in ten seconds, by the simulator itself.
    assert torch.equal(clear(state, bare, 10)[~bare.all(-1)], ~released[~bare.all(-1)])
    for row in released.nonzero().flatten()[:5].tolist():
        plans = torch.from_numpy(manoeuvres.table)
        for action in bare[row].nonzero().flatten().tolist():
            assert collides(state[row], action, plans, 10)


def collides(state: torch.Tensor, first: int, plans: torch.Tensor, steps: int) -> bool:
    """Return whether all manoeuvres behind an action collide, if ships hold course and speed."""
    step, manoeuvres = Transition(WORLD), Manoeuvres(WORLD)
    now, hit = state.repeat(len(plans), 1), torch.zeros(len(plans), dtype=torch.bool)
    behaviour = target_ships(now)[..., SHIP_BEHAVIOUR]
    behaviour[behaviour == GIVES_WAY] = HOLDS_COURSE
    action, arrived = torch.full((len(plans),), first), torch.zeros_like(hit)
    for _ in range(steps):
        after = step(now, action)
        hit |= after.collision & ~arrived
        arrived |= after.goal
        action, plans = manoeuvres.follow(after.state, plans)
        now = after.state
    return bool(hit.all())


def test_a_mask_of_your_own_may_forbid_all_which_allows_all(tmp_path: Path) -> None:
    (tmp_path / "mine.py").write_text(OWN)
    mask, state = load_mask(f"{tmp_path}/mine.py:make", WORLD), state_of(HEAD_ON).repeat(2, 1)
    state[1, STEP] = 3
    assert mask(state).sum(-1).tolist() == [1, 7]
    for function, told in (("number", r"returns 3; allowed: bool \[2, 7\]"), ("fails", "ZeroDivisionError")):
        with pytest.raises(ConfigError, match=f"mask: .*mine.py:{function} .*{told}"):
            load_mask(f"{tmp_path}/mine.py:{function}", WORLD)(state)


# Straight on in the first step, nothing later.
OWN = """
import torch

def make(world):
    straight = torch.arange(len(world.actions)) == world.straight_action
    return lambda state: straight & (state[:, 7:8] == 0)

def number(world):
    return lambda state: 3

def fails(world):
    return lambda state: 1 / 0
"""


def network_file(path: Path, mask: str | None) -> str:
    network = make_network(load_network("vector"), 7, Generator().manual_seed(0))
    network.mask = mask
    save_weights(path, network, {})
    return str(path)


def test_a_network_that_was_trained_under_a_mask_keeps_it(tmp_path: Path) -> None:
    suite = load_suite("traffic", WORLD)
    env = make_env(suite, WORLD, starts=draw_starts(suite, WORLD, 60, 60))
    mask, broken = RulesMask(WORLD), []
    for name, given in (("bare", None), ("bound", "rules")):
        file = network_file(tmp_path / f"{name}.safetensors", given)
        policy = load_policy(file, env)
        assert policy.observation == ("vector" if given is None else "state")
        episodes = rollout(env, policy)
        allowed = torch.cat([mask(one.states[:-1]).gather(-1, one.actions[:, None]) for one in episodes])
        broken.append(int((~allowed).sum()))
        laid = rollout(env, load_policy(f"{file}+rules", env))
        same = [torch.equal(a.actions, b.actions) for a, b in zip(episodes, laid, strict=True)]
        assert all(same) == (given is not None)
        assert episodes[0].q_values is not None and bool(episodes[0].q_values.isfinite().all())
    assert broken[0] > 0 == broken[1]


def test_a_file_does_not_say_what_is_imported(tmp_path: Path) -> None:
    (tmp_path / "mine.py").write_text(OWN)
    own = f"{tmp_path}/mine.py:make"
    file = network_file(tmp_path / "own.safetensors", own)
    env = make_env(load_suite("4", WORLD), WORLD)
    with pytest.raises(ConfigError, match=r"whose code runs if you name it; allowed: .*\+.*mine\.py:make$"):
        load_policy(file, env)
    assert rollout(env, load_policy(f"{file}+{own}", env))[0].actions[0] == WORLD.straight_action


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
    bare, shielded = (rollout(env, load_policy("keep_course" + more, env)) for more in ("", "+shield"))
    assert sum(one.goal for one in bare) < 30 and sum(one.goal for one in shielded) > 58


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
    Path("a+mine.py").touch()
    assert split_masks("a+mine.py:policy") == ("a+mine.py:policy", ())
    Path("mine.py").touch()
    assert split_masks("vo+mine.py:make+shield") == ("vo", ("mine.py:make", "shield"))
    with pytest.raises(
        ConfigError, match=r"policy: must be a policy with masks: rules, shield, module:funct"
    ):
        split_masks("vo+none.py:make")
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
