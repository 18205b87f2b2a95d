"""The case base: trained networks stored by case and found by similarity. No torch.

An entry is a folder `<case>/<arm>/seed=<k>-<config hash>/` with `entry.json` (case, its fingerprint,
config hash, scores), `config.yaml` and `policy.safetensors`. It is written under a temporary name and
renamed, so that no process sees an incomplete entry.
"""

from __future__ import annotations

import json
import math
import secrets
import shutil
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from filelock import FileLock

from ship_trl.config.arm import Arm, Method
from ship_trl.config.errors import ConfigError
from ship_trl.config.types import World
from ship_trl.files.disk import links, read_json, sync, writing
from ship_trl.sim.cases import Case
from ship_trl.transfer.similarity import MEASURES, similarity

POLICY, POLICY_LAST = "policy.safetensors", "policy_last.safetensors"
ENTRY, CONFIG = "entry.json", "config.yaml"
# Further folders in the case base: locks, and plans of the planner.
LOCKS, PLANS = ".locks", ".plans"
# Halfway between the paper's high pair (0.83) and its low one (0.45), table 2.
HIGH_SIMILARITY = 0.64


@dataclass(frozen=True)
class Entry:
    """A stored network: its folder, case, arm, settings and scores.

    `network` describes its layers; None means the paper's layers.
    """

    path: Path
    case: str
    fingerprint: str
    arm: str
    seed: int
    config_hash: str
    scores: dict[str, Any]
    network: dict[str, Any] | None = None

    @property
    def policy(self) -> Path:
        """Path of the weights with the best greedy evaluation."""
        return self.path / POLICY

    @property
    def best_return(self) -> float:
        """Best greedy return; minus infinity if the entry has none."""
        try:
            return float(self.scores["best"]["return"])
        except (KeyError, TypeError, ValueError, OverflowError):
            return -math.inf


@dataclass(frozen=True)
class Match:
    """A source case, its value by each of `MEASURES`, and the arm that the paper recommends for it."""

    case: Case
    measured: dict[str, float]
    arm: Arm


class CaseBase:
    """The stored networks below a folder, which is created with the first one."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def entries(self) -> list[Entry]:
        """List all valid entries, sorted by path; skip other folders."""
        found = []
        for file in sorted(self.folder.glob(f"*/*/seed=*/{ENTRY}")):
            try:
                values = read_json(file)
                one = Entry(path=file.parent, **values)
            except (OSError, ValueError, TypeError, AttributeError):
                continue
            texts = (str(one.path), one.case, one.fingerprint, one.arm, one.config_hash)
            if all(type(text) is str and text.isprintable() for text in texts) and type(one.seed) is int:
                found.append(one)
        return found

    def representative(self, case: Case) -> Entry | None:
        """Find the stored network of a case that has the best greedy return (section 4.3).

        Networks with other layers than the paper's are skipped.
        """
        stored = [e for e in self.entries() if e.fingerprint == case.fingerprint and e.policy.is_file()]
        usable = [e for e in stored if e.network is None and e.best_return > -math.inf]
        return max(usable, key=lambda entry: entry.best_return, default=None)

    def place(self, case: Case, arm: str, seed: int, config_hash: str) -> Path:
        """Return the folder of an entry; it need not exist."""
        return self.folder / case.name / arm / f"seed={seed}-{config_hash}"

    def lock(self, case: Case, arm: str, seed: int, config_hash: str) -> FileLock:
        """Return the lock to hold while an entry is made, so that no other process makes the same entry.

        Its file below `.locks` is never deleted: another process may be waiting for it.
        """
        locks = self.folder / LOCKS
        locks.mkdir(parents=True, exist_ok=True)
        return FileLock(locks / f"{case.name}-{arm}-{seed}-{config_hash}.lock")

    def refuse_links(self, case: Case, arm: str, seed: int, config_hash: str) -> None:
        """Check that entry, plans and locks would not be written through a link.

        Raises:
            ConfigError: there is a link.
        """
        places = (self.place(case, arm, seed, config_hash), self.folder / LOCKS, self.folder / PLANS)
        for place in places:
            if linked := links(place, self.folder):
                raise ConfigError(
                    f"case_base: {linked[0]} is a link; allowed: only case_base= itself may be one"
                )

    def find(self, case: Case, arm: str, seed: int, config_hash: str) -> Entry | None:
        """Find the entry of exactly this case and these settings; None if there is none."""
        place = self.place(case, arm, seed, config_hash)
        found = [e for e in self.entries() if e.path == place and e.fingerprint == case.fingerprint]
        # A power cut can leave an empty file.
        is_complete = found and found[0].policy.is_file() and found[0].policy.stat().st_size > 0
        return found[0] if is_complete else None

    def retain(
        self,
        case: Case,
        arm: str,
        seed: int,
        config_hash: str,
        scores: dict[str, Any],
        run: Path,
        network: dict[str, Any] | None = None,
    ) -> Entry:
        """Store the network of a finished run; an existing entry is kept, because it has the same network."""
        place = self.place(case, arm, seed, config_hash)
        entry = Entry(place, case.name, case.fingerprint, arm, seed, config_hash, scores, network)
        if self.find(case, arm, seed, config_hash):
            return entry
        self.refuse_links(case, arm, seed, config_hash)
        draft = place.with_name(f".{place.name}.{secrets.token_hex(4)}")
        for name in (POLICY, CONFIG):
            if (run / name).is_symlink():
                # Through a link, a private file of this machine would be copied into the case base.
                raise ConfigError(f"output: {run / name} is a link; allowed: the file itself")
        draft.mkdir(parents=True)
        try:
            for name in (POLICY, CONFIG):
                shutil.copyfile(run / name, draft / name)
            about = {key: value for key, value in asdict(entry).items() if key != "path"}
            with writing(draft / ENTRY):
                (draft / ENTRY).write_text(json.dumps(about, indent=1, sort_keys=True))
            for path in (*(draft / name for name in (POLICY, CONFIG, ENTRY)), draft):
                sync(path)
            if place.exists() and not self.find(case, arm, seed, config_hash):
                shutil.rmtree(place)
            draft.rename(place)
            sync(place.parent)
        except OSError:
            # Another process may have stored the same entry in the meantime.
            if not (place / ENTRY).is_file():
                raise
        finally:
            shutil.rmtree(draft, ignore_errors=True)
        return entry


def rank(target: Case, bases: list[Case], world: World, by: str = "similarity") -> list[Match]:
    """Rank source cases by one of `MEASURES`, the most similar first; ties keep the order of `bases`."""
    matches = [
        Match(
            base,
            {name: measure.value(base, target, world) for name, measure in MEASURES.items()},
            recommend(base, target),
        )
        for base in bases
    ]
    sign = 1.0 if MEASURES[by].nearer else -1.0
    return sorted(matches, key=lambda match: sign * match.measured[by])


def recommend(base: Case, target: Case) -> Arm:
    """Recommend the arm that the paper's results favour at this similarity (conclusions 2 and 3).

    At high similarity freeze three layers, which are better than four. At low similarity finetune only the
    first layer, because the return falls with each further layer. These are the paper's findings; a study
    measures whether they hold.
    """
    if similarity(base, target) >= HIGH_SIMILARITY:
        return Arm(Method.feature_extraction, 3)
    return Arm(Method.finetune, 1)
