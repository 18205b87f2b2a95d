"""Search for scenes in which a policy fails, by a (1 + lambda) evolution strategy with restarts.

A search begins with random scenes of a suite. It then changes the scene in which the policy had the least
margin (`exam.Ends`). Steps grow after a better scene and shrink without one (Schumer and Steiglitz 1968);
when they are small, the search begins again. Every scene keeps the suite's bounds, and a held manoeuvre
solves it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import torch
from torch import Generator, Tensor

from ship_trl.config.types import Traffic
from ship_trl.fast.worlds import make_starts
from ship_trl.policies import exam
from ship_trl.policies.registry import Entry
from ship_trl.sim.starts import BANDS
from ship_trl.sim.state import SHIP_SPEED, SPEED, target_ships

# Scenes of a generation, and draws of a change until one keeps the bounds.
CHILDREN, DRAWS = 8, 8
# The share of its numbers that a child changes; the first and the least step, as shares of the bounds; what a
# better scene or none multiplies a step by.
CHANGED, FIRST_STEP, MIN_STEP, GROWTH, SHRINKAGE = 0.4, 0.1, 0.01, 1.5, 0.85


@dataclass(frozen=True)
class Found:
    """What R searches found.

    Attributes:
        tries: scenes up to the first failure, infinite where there was none, [R].
        scenes: the states of the F failures, float32 [F, S].
        collision: which of them are collisions, bool [F].
    """

    tries: exam.Array
    scenes: Tensor
    collision: exam.Array


def keep_speeds(states: Tensor, traffic: Traffic) -> exam.Array:
    """Return in which states [N, S] every ship has a speed that the traffic gives its class of encounter."""
    encounter, _, _ = exam.describe_ships(states)
    speed, own = target_ships(states)[..., SHIP_SPEED].numpy(), states[:, SPEED, None].numpy()
    keeps = np.zeros(encounter.shape, bool)
    for one, (_, _, shares) in BANDS.items():
        ends = zip(shares, traffic.speeds, strict=True)
        low, high = (end if share is None else share * own for share, end in ends)
        keeps |= (encounter == one) & (speed >= low) & (speed <= high)
    return np.asarray(keeps.all(-1))


def change(
    states: Tensor, size: exam.Array, entry: Entry, numbers: np.random.Generator
) -> tuple[Tensor, exam.Array]:
    """Change all ships of states [N, S] by steps of a size [N], as a share of the bounds.

    Returns:
        The states, and which of them keep the bounds of the entry's suite and are solvable, bool [N].
    """
    traffic, world, states, before = entry.suite.traffic, entry.world, states.clone(), exam.read_ships(states)
    assert traffic is not None
    low, high = exam.bounds_of(traffic, world.actions[world.straight_action][0])
    step = size[:, None, None] * (high - low) * numbers.normal(size=before.shape)
    ships = before + step * (numbers.random(before.shape) < CHANGED)
    exam.place_ships(states, ships)
    # A course has no bounds.
    kept = ((ships >= low) & (ships <= high))[..., 1:].all((1, 2))
    kept &= exam.are_drawn(states, traffic) & keep_speeds(states, traffic)
    kept[kept] = exam.are_solvable(states[torch.from_numpy(kept)], world)
    return states, kept


def search(
    entry: Entry,
    ships: int,
    searches: int,
    most: int,
    seed: int = 0,
    is_random: bool = False,
    show: Callable[[float], None] = lambda _: None,
) -> Found:
    """Search for failures of a policy on a suite of random encounters.

    Args:
        entry: the policy and the suite.
        ships: target ships of each scene.
        searches: R; each ends with its first failure.
        most: tries after which a search gives up, rounded up to whole generations.
        seed: of all random numbers.
        is_random: whether to draw every scene from the suite, as a control.
        show: is given the share of the tries that is done.
    """
    starts = make_starts(exam.with_ships(entry.suite, ships), entry.world)
    generator, numbers = Generator().manual_seed(seed), np.random.default_rng(seed)
    tries, scenes, collisions = np.full(searches, np.inf), list[Tensor](), list[bool]()
    parents, least, step = starts.sample(searches, generator), np.full(searches, np.inf), np.zeros(searches)
    for done in range(0, most, CHILDREN):
        active = np.isinf(tries).nonzero()[0]
        if not len(active):
            break
        show(done / most)
        # Random scenes, in place of which come changed ones where there is a step.
        children = starts.sample(CHILDREN * len(active), generator)
        exam.place_ships(children, exam.read_ships(children))
        left = np.repeat(step[active] > 0, CHILDREN).nonzero()[0]
        for _ in range(DRAWS):
            parent = active[left // CHILDREN]
            changed, kept = change(parents[parent], step[parent], entry, numbers)
            children[left[kept]] = changed[torch.from_numpy(kept)]
            left = left[~kept]
        ends = exam.run_scenes(entry, children, seed)
        for one, failed, margin, first in zip(
            active,
            ~ends.goal.reshape(-1, CHILDREN),
            ends.margin.reshape(-1, CHILDREN),
            range(0, len(children), CHILDREN),
            strict=True,
        ):
            child = int(failed.argmax() if failed.any() else margin.argmin())
            if failed[child]:
                tries[one] = done + child + 1
                scenes.append(children[first + child])
                collisions.append(bool(ends.collision[first + child]))
            elif margin[child] < least[one]:
                parents[one], least[one] = children[first + child], margin[child]
                step[one] = GROWTH * step[one] or FIRST_STEP
            else:
                step[one] *= SHRINKAGE
            if is_random or step[one] < MIN_STEP:
                step[one], least[one] = 0.0, np.inf
    return Found(tries, torch.stack(scenes) if scenes else parents[:0], np.array(collisions, bool))
