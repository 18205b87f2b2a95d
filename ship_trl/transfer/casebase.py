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
from ship_trl.files.result import RENAMED
from ship_trl.sim.cases import Case
from ship_trl.transfer.similarity import MEASURES, similarity

POLICY, POLICY_LAST = "policy.safetensors", "policy_last.safetensors"
ENTRY, CONFIG = "entry.json", "config.yaml"
# Folders beside those of the cases: locks, and routes found by the planner.
LOCKS, PLANS = ".locks", ".plans"
# Halfway between the paper's high pair (0.83) and its low one (0.45), table 2.
HIGH_SIMILARITY = 0.64


@dataclass(frozen=True)
class Entry:
    """A stored network: its folder, case, arm, settings and scores.

    `network` describes its layers; None means those of the paper.
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
    """A source case, its value by every measure, and the arm that the paper recommends for it."""

    case: Case
    measured: dict[str, float]
    arm: Arm


class CaseBase:
    """The entries below a folder, which is created with the first entry."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def entries(self) -> list[Entry]:
        """List all valid entries, sorted by path; skip other folders."""
        found = []
        for file in sorted(self.folder.glob(f"*/*/seed=*/{ENTRY}")):
            try:
                values = read_json(file)
                one = Entry(path=file.parent, **{RENAMED.get(k, k): v for k, v in values.items()})
            except (OSError, ValueError, TypeError, AttributeError):
                continue
            texts = (str(one.path), one.case, one.fingerprint, one.arm, one.config_hash)
            if all(type(text) is str and text.isprintable() for text in texts) and type(one.seed) is int:
                found.append(one)
        return found

    def place(self, case: Case, arm: str, seed: int, config_hash: str) -> Path:
        """Return the folder of an entry, which may not exist."""
        return self.folder / case.name / arm / f"seed={seed}-{config_hash}"

    def lock(self, case: Case, arm: str, seed: int, config_hash: str) -> FileLock:
        """Return the lock to hold while an entry is made, so that no other process makes it too.

        Its file below `.locks` is never deleted: another process may be waiting for it.
        """
        locks = self.folder / LOCKS
        locks.mkdir(parents=True, exist_ok=True)
        return FileLock(locks / f"{case.name}-{arm}-{seed}-{config_hash}.lock")

    def refuse_links(self, case: Case, arm: str, seed: int, config_hash: str) -> None:
        """Refuse a case base where an entry, a plan or a lock would be written through a link.

        Raises:
            ConfigError: there is such a link.
        """
        places = (self.place(case, arm, seed, config_hash), self.folder / LOCKS, self.folder / PLANS)
        for place in places:
            if linked := links(place, self.folder):
                raise ConfigError(
                    f"case_base: {linked[0]} is a link; allowed: only case_base= itself may be one"
                )

    def find(self, case: Case, arm: str, seed: int, config_hash: str) -> Entry | None:
        """Find the entry of exactly this case and these settings, or None."""
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
        """Store the network of a finished run; keep an existing entry, which has the same network."""
        place = self.place(case, arm, seed, config_hash)
        entry = Entry(place, case.name, case.fingerprint, arm, seed, config_hash, scores, network)
        if self.find(case, arm, seed, config_hash):
            return entry
        self.refuse_links(case, arm, seed, config_hash)
        draft = place.with_name(f".{place.name}.{secrets.token_hex(4)}")
        for name in (POLICY, CONFIG):
            if (run / name).is_symlink():
                # A link could publish a private file of this machine.
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
    """Rank source cases by one of `MEASURES`, the most similar first.

    On ties keep the order of `bases`, so that the ranking is the same on every machine.
    """
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

    High similarity: freeze three layers, which beat four. Low similarity: finetune the first layer only,
    because the return falls with every further layer. These are the paper's findings; a study measures
    whether they hold.
    """
    if similarity(base, target) >= HIGH_SIMILARITY:
        return Arm(Method.feature_extraction, 3)
    return Arm(Method.finetune, 1)
