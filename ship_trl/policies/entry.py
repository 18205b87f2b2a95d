"""A policy on a case or a suite, by name, and its episodes."""

from __future__ import annotations

import statistics
import time
from collections.abc import Iterable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ship_trl.config.types import World
from ship_trl.policies.registry import POLICIES, Kind, kind_of
from ship_trl.sim.cases import Case
from ship_trl.sim.suites import Suite, suite_of

if TYPE_CHECKING:
    from tensordict import TensorDictBase
    from torch import Tensor

    from ship_trl.learn.rollout import Episode, Policy
    from ship_trl.sim.env import ShipEnv

# Tables show one decimal: a return that differs by more than half of it is not the claimed one.
SHOWN = 0.05
# Episodes of an entry whose starts are perturbed.
EPISODES = 100
# Scenes of random encounters that are shown one by one.
EXAMPLES = 8
# Added to the seed of the starts, whose random numbers must not be those of a policy.
STARTS_SEED = 1_000_003


@dataclass(frozen=True)
class Entry:
    """A policy by name on a suite; `claimed` is the return in its result or manifest."""

    policy: str
    label: str
    suite: Suite
    world: World
    colour: bool
    claimed: float | None = None

    @property
    def draws(self) -> bool:
        """Whether two episodes of a case may differ: by their starts, or by a policy that draws."""
        kind = kind_of(self.policy)
        draws = POLICIES[self.policy].draws if kind is Kind.named else kind is Kind.own
        return self.suite.is_drawn or draws

    @property
    def case(self) -> Case:
        """The case of a suite of one, see `Suite.case`."""
        return self.suite.case


def split_suites(entries: Iterable[Entry], seed: int = 0) -> list[Entry]:
    """Return an entry for each case of each suite, or for the scenes of the seeds from `seed` on.

    Only a suite of one case claims a return.
    """
    found: list[Entry] = []
    for entry in entries:
        suites = entry.suite.split() if entry.suite.cases else example_scenes(entry.suite, entry.world, seed)
        claimed = entry.claimed if len(suites) == 1 else None
        found += [replace(entry, suite=suite, claimed=claimed) for suite in suites]
    return found


def example_scenes(suite: Suite, world: World, first: int) -> list[Suite]:
    """Return a suite of one for each of the seeds from `first` on of a suite of random encounters."""
    from ship_trl.sim.state import first_case

    states = draw_starts(suite, world, EXAMPLES, first)
    names = (f"{suite.name}_{seed}" for seed in range(first, first + EXAMPLES))
    return [
        suite_of(replace(first_case(suite, state), name=name))
        for name, state in zip(names, states, strict=True)
    ]


def draw_starts(suite: Suite, world: World, count: int, seed: int) -> Tensor:
    """Return states [count, S] at the start: of cases in turn, or of random encounters by seed."""
    import torch
    from torch import Generator

    from ship_trl.fast.worlds import make_starts

    starts = make_starts(suite, world)
    if suite.cases:
        return starts.balanced(count, Generator().manual_seed(seed + STARTS_SEED))
    return torch.cat([starts.sample(1, Generator().manual_seed(seed + k)) for k in range(count)])


def failures_first(entries: list[Entry], seed: int = 0) -> list[Entry]:
    """Return the entries, but first those of the first policy that miss the goal; single cases alone."""
    first = entries[0].policy
    if sum(entry.policy == first for entry in entries) == 1:
        return entries
    return sorted(
        entries, key=lambda entry: entry.policy != first or rollout_entry(entry, 1, seed)[2][0].goal
    )


def rollout_entry(
    entry: Entry, episodes: int | None = None, seed: int = 0
) -> tuple[ShipEnv, Policy, list[Episode]]:
    """Roll out episodes in one batch, the cases in turn; return the environment, the policy and the episodes.

    `episodes` is their number, by default each case once, or `EPISODES` if the starts are perturbed; it is
    rounded up so that each case has equally many. Where nothing is drawn, each case has one. The seed is of
    the starts and of a policy that draws.

    Raises:
        ConfigError: there is no such policy, or its file is invalid.
    """
    from ship_trl.learn.rollout import rollout

    suite = entry.suite
    default = EPISODES if suite.is_drawn else 1
    count = suite.whole_rounds((entry.draws and episodes) or default)
    env, policy = make_policy(entry, draw_starts(suite, entry.world, count, seed), seed)
    return env, policy, rollout(env, policy)


def time_decision(entry: Entry, start: Tensor, seed: int = 0) -> float:
    """Return the median time (ms) in which the policy decides in one episode from a state [S].

    A network's time includes drawing its pixels.
    """
    from ship_trl.learn.rollout import rollout

    env, policy = make_policy(entry, start[None], seed)
    times: list[float] = []

    def timed(step: TensorDictBase) -> TensorDictBase:
        begin = time.perf_counter()
        acted = policy(step)
        times.append(time.perf_counter() - begin)
        return acted

    rollout(env, timed)
    return 1000 * statistics.median(times)


def make_policy(entry: Entry, starts: Tensor, seed: int) -> tuple[ShipEnv, Policy]:
    """Return an entry's policy, and the environment whose rows begin with states [N, S].

    Raises:
        ConfigError: there is no such policy, or its file is invalid.
    """
    from ship_trl.fast.worlds import make_env
    from ship_trl.policies.named import load_policy
    from ship_trl.transfer.weights import read_look

    # Networks draw their own pixels, and policies without training read only the state.
    kind, colour, vector_time = kind_of(entry.policy), entry.colour, 0.0
    if kind is Kind.network:
        look = read_look(Path(entry.policy), "policy")
        colour, vector_time = look.colour, look.network.vector_time
    seen: dict[str, Any] = {"colour": colour, "vector_time": vector_time, "from_pixels": kind is Kind.own}
    env = make_env(entry.suite, entry.world, **seen, starts=starts)
    return env, load_policy(entry.policy, env, seed)
