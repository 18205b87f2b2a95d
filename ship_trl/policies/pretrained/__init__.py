"""Which trained networks come with the package, and what each of them reaches. No torch.

`manifest.json` beside this file says it, with the runs of which they are the best; `curves.csv.xz` holds
the training returns of those runs. `ship_trl/cli/pretrain.py` makes them all.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ship_trl.config.errors import ConfigError
from ship_trl.sim.cases import Case

if TYPE_CHECKING:
    import pandas as pd

# The word that stands for these networks on a command line; `pretrained:3` is that of case 3.
PRETRAINED = "pretrained"
NETWORKS = Path(__file__).parent
MANIFEST, CURVES = "manifest.json", "curves.csv.xz"


@dataclass(frozen=True)
class Pretrained:
    """A network that comes with the package.

    `case` and `fingerprint` name the case that it was trained on, `arm`, `seed` and `config_hash` the run.
    Its greedy episode has `episode_return` (raw), `outcome`, `length` (steps) and `dcpa` (m, None without
    target ships), and reaches the share `of_best_known` of the planner's return. `sha256` and `dtype` are
    the file's.
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
        """Where its weights lie."""
        return NETWORKS / f"{self.case}.safetensors"


@cache
def networks() -> tuple[Pretrained, ...]:
    """Return the bundled networks, by case."""
    return tuple(Pretrained(**values) for values in read()["networks"])


def read() -> dict[str, Any]:
    """Read the manifest: `networks`, and the `runs` they come from (case, seed, config_hash, best_return)."""
    found: dict[str, Any] = json.loads((NETWORKS / MANIFEST).read_text())
    return found


def is_pretrained(name: str) -> bool:
    """Return whether a policy's name is `pretrained` or `pretrained:CASE`."""
    return name.partition(":")[0] == PRETRAINED


def find(name: str, case: Case | None, key: str = "policy") -> Pretrained:
    """Find the network that a name stands for.

    Args:
        name: `pretrained` for the network of `case`, or `pretrained:NAME` for that of another case.
        case: where it will act; used for `pretrained` only. The name of the case does not matter.
        key: the key that errors name.

    Raises:
        ConfigError: there is no network of that case.
    """
    wanted = name.partition(":")[2]
    for one in networks():
        if one.case == wanted or (case and not wanted and one.fingerprint == case.fingerprint):
            return one
    if case and not wanted and any(one.case == case.name for one in networks()):
        raise ConfigError(
            f"{key}: case {case.name} differs from the bundled case of this name; "
            f"allowed: {PRETRAINED}:{case.name}, which was trained on the bundled one"
        )
    of, allowed = wanted or (case.name if case else "none"), ", ".join(one.case for one in networks())
    raise ConfigError(f"{key}: no bundled network of case {of}; allowed: {allowed}")


def training_returns(config_hashes: set[str]) -> pd.DataFrame:
    """Read the training returns of the runs with these configuration hashes.

    Returns:
        `config_hash`, `episode`, `return` (raw); empty if no run has one of them.
    """
    import pandas as pd

    rows = pd.read_csv(NETWORKS / CURVES)
    return rows[rows["config_hash"].isin(config_hashes)]
