"""The bundled networks and the returns that they reach. No torch.

`ship_trl/cli/pretrain.py` writes the networks, `manifest.json`, which lists them and the runs that they were
chosen from, and `curves.csv.xz`, the training returns of those runs.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ship_trl.config.errors import ConfigError
from ship_trl.sim.suites import Suite

if TYPE_CHECKING:
    import pandas as pd

# Names these networks on the command line; `pretrained:3` is the network of case 3.
PRETRAINED = "pretrained"
NETWORKS = Path(__file__).parent
MANIFEST, CURVES = "manifest.json", "curves.csv.xz"


@dataclass(frozen=True)
class Pretrained:
    """A bundled network: its case or suite, its run, its greedy episode, and the file of its weights.

    `episode_return` is raw, `of_best_known` its share of the planner's return, `length` in steps, and `dcpa`
    in metres (None without target ships).
    """

    case: str
    fingerprint: str
    arm: str
    seed: int
    config_hash: str
    episode_return: float
    of_best_known: float
    outcome: str
    length: int
    dcpa: float | None
    dtype: str
    sha256: str

    @property
    def file(self) -> Path:
        """The file of its weights."""
        return NETWORKS / f"{self.case}.safetensors"


@cache
def networks() -> tuple[Pretrained, ...]:
    """Return the bundled networks, by case."""
    return tuple(Pretrained(**values) for values in read()["networks"])


def read() -> dict[str, Any]:
    """Read the manifest: version, `networks`, and `runs` with case, seed, config_hash and best_return."""
    found: dict[str, Any] = json.loads((NETWORKS / MANIFEST).read_text())
    return found


def is_pretrained(name: str) -> bool:
    """Return whether a name is `pretrained` or `pretrained:CASE`."""
    return name.partition(":")[0] == PRETRAINED


def find(name: str, suite: Suite | None, key: str = "policy") -> Pretrained:
    """Find the bundled network `pretrained:CASE`, or for `pretrained` the network of `suite`, by fingerprint.

    A perturbed suite without a network of its own has that of its cases as they are.

    Raises:
        ConfigError: there is no such network; the message names `key`.
    """
    wanted = name.partition(":")[2]
    if wanted or suite is None:
        found = [one for one in networks() if one.case == wanted]
    else:
        either = suite.fingerprint, suite.unperturbed.fingerprint
        found = [one for fingerprint in either for one in networks() if one.fingerprint == fingerprint]
    if found:
        return found[0]
    kind = "suite" if suite and len(suite.cases) != 1 else "case"
    if suite and not wanted and any(one.case == suite.name for one in networks()):
        raise ConfigError(
            f"{key}: {kind} {suite.name} differs from the bundled {kind} of this name; "
            f"allowed: {PRETRAINED}:{suite.name}, which was trained on the bundled one"
        )
    of = f"case {wanted}" if wanted or not suite else f"{kind} {suite.name}"
    allowed = ", ".join(one.case for one in networks())
    raise ConfigError(f"{key}: no bundled network of {of}; allowed: {allowed}")


def training_returns(config_hashes: set[str]) -> pd.DataFrame:
    """Read `config_hash`, `episode` and `return` (raw) of the training runs with these hashes."""
    import pandas as pd

    rows = pd.read_csv(NETWORKS / CURVES)
    return rows[rows["config_hash"].isin(config_hashes)]
