"""The bundled networks and the returns that they reach. No torch.

`ship_trl/cli/pretrain.py` writes the networks, `manifest.json`, which lists them and the runs that they were
chosen from, and `curves.csv.xz`, the training returns of those runs.
"""

from __future__ import annotations

import json
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ship_trl.config.errors import ConfigError
from ship_trl.config.paths import conf_dir
from ship_trl.sim.cases import UNPERTURBED, Suite

if TYPE_CHECKING:
    import pandas as pd

# Names these networks on the command line; `pretrained:3` is the network of case 3, `pretrained:traffic` that
# of random encounters.
PRETRAINED = "pretrained"
# The factor of rewards in the profiles that trained them, quick and traffic.
REWARD_SCALE = 0.1
NETWORKS = Path(__file__).parent
MANIFEST, CURVES = "manifest.json", "curves.csv.xz"


@dataclass(frozen=True)
class Pretrained:
    """A bundled network: its name, the case or suite of its run, the run, and the file of its weights."""

    name: str
    target: str
    arm: str
    seed: int
    config_hash: str
    dtype: str
    sha256: str

    @property
    def file(self) -> Path:
        """The file of its weights."""
        return NETWORKS / f"{self.name}.safetensors"

    def claim(self, suite: Suite) -> float | None:
        """Return the return that it claims to reach on `suite`; None on all that it was not measured on."""
        return None


@dataclass(frozen=True)
class CaseNetwork(Pretrained):
    """The bundled network of a case, and its greedy episode.

    `episode_return` is raw, `of_best_known` its share of the planner's return, `length` in steps, and `dcpa`
    in metres (None without target ships).
    """

    fingerprint: str
    episode_return: float
    of_best_known: float
    outcome: str
    length: int
    dcpa: float | None

    def claim(self, suite: Suite) -> float | None:
        """Return the return of its greedy episode on its case, not on another of the same name."""
        return self.episode_return if self.fingerprint == suite.fingerprint else None


@dataclass(frozen=True)
class SuiteNetwork(Pretrained):
    """A bundled network of random encounters: what it observes, and its success rates.

    `success_rates` are those of its greedy episodes on suites, `success_rates_by_seed` those of the best
    evaluation of each seed's run.
    """

    observation: str
    success_rates: dict[str, float]
    success_rates_by_seed: dict[str, float]


@cache
def networks() -> tuple[CaseNetwork, ...]:
    """Return the bundled networks of cases."""
    return tuple(CaseNetwork(**values) for values in read()["networks"])


@cache
def suites() -> tuple[SuiteNetwork, ...]:
    """Return the bundled networks of random encounters; the first is for suites without a network."""
    return tuple(SuiteNetwork(**values) for values in read().get("suites", ()))


def read() -> dict[str, Any]:
    """Read the manifest: version, `networks`, `suites`, and `runs`, the runs of the cases.

    A run has case, seed, config_hash and best_return.
    """
    found: dict[str, Any] = json.loads((NETWORKS / MANIFEST).read_text())
    return found


def is_pretrained(name: str) -> bool:
    """Return whether a name is `pretrained` or `pretrained:NAME`."""
    return name.partition(":")[0] == PRETRAINED


def find(name: str, suite: Suite | None, key: str = "policy", observation: str | None = None) -> Pretrained:
    """Find the bundled network `pretrained:NAME`, or for `pretrained` the network for `suite`.

    That of a case is found by fingerprint, whether its starts are perturbed or not. A suite, or a bundled
    case without a network, gets the first network of random encounters, or the first with this `observation`.

    Raises:
        ConfigError: there is no such network; the message names `key`.
    """
    wanted = name.partition(":")[2]
    every: tuple[Pretrained, ...] = (*networks(), *suites())
    if wanted or suite is None:
        kind, of = "case", wanted
        found = [one for one in every if one.name == wanted]
    else:
        kind, of = "case" if len(suite.cases) == 1 else "suite", suite.name
        fingerprint = replace(suite, perturbation=UNPERTURBED).fingerprint
        found = [one for one in networks() if one.fingerprint == fingerprint]
        if not found and any(one.name == of for one in networks()):
            raise ConfigError(
                f"{key}: case {of} differs from the bundled case of this name; "
                f"allowed: {PRETRAINED}:{of}, which was trained on the bundled one"
            )
        if kind == "suite" or (conf_dir() / "case" / f"{of}.yaml").is_file():
            found += [one for one in suites() if observation in (None, one.observation)]
    if found:
        return found[0]
    if observation:
        of += f" for observation={observation}"
    allowed = ", ".join(one.name for one in every)
    raise ConfigError(f"{key}: no bundled network of {kind} {of}; allowed: {allowed}")


def training_returns(config_hashes: set[str]) -> pd.DataFrame:
    """Read `config_hash`, `episode` and `return` (raw) of the training runs with these hashes."""
    import pandas as pd

    rows = pd.read_csv(NETWORKS / CURVES)
    return rows[rows["config_hash"].isin(config_hashes)]
