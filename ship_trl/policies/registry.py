"""The policies that have a name, what other words for a policy mean, and a policy on a suite. No torch."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from enum import Enum
from pathlib import Path

from ship_trl.config import checks
from ship_trl.config.errors import ConfigError
from ship_trl.config.types import World
from ship_trl.policies.pretrained import PRETRAINED, is_pretrained
from ship_trl.sim.cases import Suite, suite_of


@dataclass(frozen=True)
class Named:
    """A policy by name: what makes it, what it is, and whether it draws its actions.

    `make` is `module:function` of an environment and a seed, imported when the policy is asked for.
    """

    make: str
    about: str
    draws: bool = False


# By their words on the command line.
POLICIES = {
    "random": Named("ship_trl.policies.reference:random_actions", "draws its actions", draws=True),
    "keep_course": Named("ship_trl.policies.reference:keep_course", "keeps its course"),
    "best_known": Named("ship_trl.policies.reference:follow_best_known", "follows the planner's best plan"),
    "recorded": Named("ship_trl.policies.recorded:refuse_steps", "what own ship really did in AIS traffic"),
    "vo": Named("ship_trl.policies.vo:VelocityObstacles", "velocity obstacles (Kuwata et al.)"),
    "sb_mpc": Named(
        "ship_trl.policies.sb_mpc:SimulationBasedMPC", "simulation-based predictive control (Johansen et al.)"
    ),
    "apf": Named("ship_trl.policies.apf:apf", "artificial potential field (Lyu and Yin)"),
    "manoeuvre": Named(
        "ship_trl.policies.manoeuvres:BestManoeuvre", "the held manoeuvre of the highest return"
    ),
    "manoeuvre_rules": Named(
        "ship_trl.policies.manoeuvres:best_rules", "the held manoeuvre that keeps the rules best"
    ),
}
ALLOWED = f"{', '.join(POLICIES)}, {PRETRAINED}, a safetensors or ONNX file, or file.py:function"

# Tables show one decimal: a return that differs by more than half of it is not the claimed one.
SHOWN = 0.05
# Episodes of an entry whose starts are perturbed, and random encounters that are shown one by one.
EPISODES, EXAMPLES = 100, 8

# What a word for a policy is: a name above, a bundled network, a file of a network, or a user's function.
Kind = Enum("Kind", ["named", "bundled", "network", "onnx", "sb3", "own"])
FILES = {".safetensors": Kind.network, ".onnx": Kind.onnx, ".zip": Kind.sb3}
# Before a file of Stable-Baselines3: its pickles may run.
TRUSTED = "trusted:"

# Behind a policy, each with a + before it; see `policies.masks`. A user's own is module:function, or
# file.py:function.
SHIELD = "shield"
MASKS = (*checks.MASKS, SHIELD)


def split_masks(name: str) -> tuple[str, tuple[str, ...]]:
    """Split a policy's word into the policy and the names of its masks: "vo+rules+shield".

    Raises:
        ConfigError: a mask is named twice, or its module or file does not exist.
    """
    base, plus, mask = name.rpartition("+")
    # The file of a user's policy may have a plus in its name.
    is_own = bool(plus) and ":" in mask and not Path(name.rpartition(":")[0]).exists()
    if is_own:
        checks.check_function("policy", mask, f"a policy with masks: {', '.join(MASKS)}, ")
    elif mask not in MASKS or not plus:
        return name, ()
    base, masks = split_masks(base)
    if mask in masks:
        raise ConfigError(f"policy: {name}: {mask} is given twice; allowed: once")
    return base, (*masks, mask)


def kind_of(name: str, more: Sequence[str] = ()) -> Kind:
    """Return what a word for a policy is; `more` are words that messages allow too.

    Raises:
        ConfigError: it is none, the file is missing, or it needs `TRUSTED` before it.
    """
    name, _ = split_masks(name)
    if name in POLICIES:
        return Kind.named
    if is_pretrained(name):
        return Kind.bundled
    file = Path(name.removeprefix(TRUSTED))
    if found := FILES.get(file.suffix):
        if not file.is_file():
            raise ConfigError(f"policy: no file {file}; allowed: a {file.suffix} file that exists")
        if found is Kind.sb3 and not name.startswith(TRUSTED):
            why = "holds pickles, which run code as they are loaded; if you trust who made it"
            raise ConfigError(f"policy: {name} {why}, write {TRUSTED}{name}")
        return found
    if ":" not in name:
        raise ConfigError(f"policy: no {name}; allowed: {', '.join((*more, ALLOWED))}")
    return Kind.own


@dataclass(frozen=True)
class Entry:
    """A policy by name on a suite; `claimed` is the return in its result or manifest."""

    policy: str
    label: str
    suite: Suite
    world: World
    colour: bool
    claimed: float | None = None

    def masked(self, masks: Sequence[str]) -> Entry:
        """Return the same policy with masks, of which no return is claimed."""
        if not masks:
            return self
        behind = "".join(f"+{mask}" for mask in masks)
        return replace(self, policy=self.policy + behind, label=self.label + behind, claimed=None)

    @property
    def draws(self) -> bool:
        """Whether two episodes of a case may differ: by their starts, or by a policy that draws."""
        kind = kind_of(self.policy)
        draws = POLICIES[split_masks(self.policy)[0]].draws if kind is Kind.named else kind is Kind.own
        return self.suite.is_drawn or draws


def split_suites(entries: Iterable[Entry], seed: int = 0) -> list[Entry]:
    """Return an entry for each case of each suite, or for the random encounters of the seeds from `seed` on.

    Only a suite of one case claims a return.
    """
    found: list[Entry] = []
    for entry in entries:
        suite, cases = entry.suite, entry.suite.cases
        if not cases:
            # Imported here: most suites need no torch.
            from ship_trl.fast.worlds import draw_starts
            from ship_trl.sim.state import first_case

            states = enumerate(draw_starts(suite, entry.world, EXAMPLES, seed), seed)
            cases = tuple(replace(first_case(suite, state), name=f"{suite.name}_{k}") for k, state in states)
        claimed = entry.claimed if len(cases) == 1 else None
        alone = (suite_of(case, suite.perturbation) for case in cases)
        found += [replace(entry, suite=one, claimed=claimed) for one in alone]
    return found
