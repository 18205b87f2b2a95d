"""Demonstrations: recorded episodes as JSON files. No torch.

The world is deterministic, so the actions are the whole episode. docs/tools.md describes the format.
"""

from __future__ import annotations

import hashlib
import itertools
import json
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Annotated

from pydantic import Field

from ship_trl.config.errors import ConfigError
from ship_trl.config.schema import read_as, rule
from ship_trl.config.types import World, world_values
from ship_trl.files.disk import atomic_write, read_json
from ship_trl.sim.cases import Case

SCHEMA_VERSION = 1


@dataclass(frozen=True)
class Demonstration:
    """One episode: `case` is a name, `fingerprint` identifies the case, `world` is a digest of the physics.

    `actions` are indices into table 1. `episode_return` is raw and undiscounted. `outcome` is goal, collision
    or timeout. `by` says who chose the actions.
    """

    case: str
    fingerprint: str
    world: str
    actions: Annotated[list[Annotated[int, Field(ge=0)]], rule("at least one action", bool)]
    episode_return: float
    outcome: str
    by: str
    schema_version: Annotated[int, rule(str(SCHEMA_VERSION), SCHEMA_VERSION.__eq__)] = SCHEMA_VERSION


def digest(world: World) -> str:
    """Return a digest of physics and reward in twelve hex digits."""
    return hashlib.sha256(json.dumps(world_values(world), sort_keys=True).encode()).hexdigest()[:12]


def write_demonstration(
    folder: Path, case: Case, world: World, actions: Sequence[int], ended: tuple[float, str], by: str
) -> Path:
    """Write an episode as the next `CASE-NUMBER.json` of a folder; return the file.

    `ended` are the raw return and the outcome.

    Raises:
        OSError: the file cannot be written.
    """
    folder.mkdir(parents=True, exist_ok=True)
    found = Demonstration(case.name, case.fingerprint, digest(world), list(actions), *ended, by)
    for number in itertools.count(1):
        path = folder / f"{case.name}-{number:03d}.json"
        with suppress(FileExistsError):
            path.touch(exist_ok=False)  # another process takes the next number
            break
    try:
        with atomic_write(path) as draft:
            draft.write_text(json.dumps(asdict(found)) + "\n")
    except BaseException:  # an empty file would be refused by the next training
        path.unlink()
        raise
    return path


def read_demonstrations(folder: Path, case: Case, world: World) -> list[Demonstration]:
    """Read the demonstrations of a case in a folder, sorted by name; other cases are skipped.

    Raises:
        ConfigError: the case has no demonstration, or a file is damaged or of another world.
    """
    found = []
    for path in sorted(folder.glob("*.json")):
        one = read_demonstration(path, len(world.actions))
        if one.fingerprint != case.fingerprint:
            continue
        if one.world != digest(world):
            raise ConfigError(f"demonstrations: {path} was recorded in another world (world=)")
        found.append(one)
    if not found:
        raise ConfigError(
            f"demonstrations: none of case {case.name} in {folder}; python -m ship_trl play records some"
        )
    return found


def read_demonstration(path: Path, actions: int) -> Demonstration:
    """Read one file, whose action indices must be below `actions`.

    Raises:
        ConfigError: the file is damaged or holds no demonstration.
    """
    where = f"demonstrations: {path}: "
    try:
        one = read_as(Demonstration, read_json(path), where, from_json=True)
    except (OSError, ValueError):
        raise ConfigError(f"{where}cannot be read as JSON") from None
    if max(one.actions) >= actions:
        raise ConfigError(f"{where}actions: each must be from 0 to {actions - 1}, got {max(one.actions)}")
    return one
