"""The policies that have a name, and what other words for a policy mean. No torch."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum
from pathlib import Path

from ship_trl.config.errors import ConfigError
from ship_trl.policies.pretrained import PRETRAINED, is_pretrained


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
    "vo": Named("ship_trl.policies.vo:VelocityObstacles", "velocity obstacles (Kuwata et al.)"),
    "sb_mpc": Named(
        "ship_trl.policies.sb_mpc:SimulationBasedMPC", "simulation-based predictive control (Johansen et al.)"
    ),
    "apf": Named("ship_trl.policies.apf:apf", "artificial potential field (Khatib)"),
}
ALLOWED = f"{', '.join(POLICIES)}, {PRETRAINED}, a safetensors file, or file.py:function"


# What a word for a policy is: a name above, a bundled network, a network's file, or a user's function.
Kind = Enum("Kind", ["named", "bundled", "network", "own"])


def kind_of(name: str, more: Sequence[str] = ()) -> Kind:
    """Return what a word for a policy is; `more` are words that messages allow too.

    Raises:
        ConfigError: it is none, or the file is missing.
    """
    if name in POLICIES:
        return Kind.named
    if is_pretrained(name):
        return Kind.bundled
    if name.endswith(".safetensors"):
        if not Path(name).is_file():
            raise ConfigError(f"policy: no file {name}; a safetensors file is allowed")
        return Kind.network
    if ":" not in name:
        raise ConfigError(f"policy: no {name}; allowed: {', '.join((*more, ALLOWED))}")
    return Kind.own
