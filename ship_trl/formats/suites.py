"""A file or folder of other tools as a suite: each of its situations is a case of the simulator's size.

Two factors carry a situation over: lengths by the safe distance, speeds by own ship's. Time follows from
both. Angles, classes of encounter, and ratios of speeds and of lengths stay as they are.
"""

from __future__ import annotations

import json
import math
import os
import re
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from functools import cache
from itertools import chain, count
from pathlib import Path
from typing import Any

import numpy as np
from omegaconf import OmegaConf
from yaml import YAMLError

from ship_trl.config.bounds import KNOT, NAUTICAL_MILE
from ship_trl.config.errors import ConfigError, counted, print_error
from ship_trl.config.paths import stem
from ship_trl.config.schema import read_as
from ship_trl.config.types import Perturbation, Situations, Targets, Traffic, World, plain
from ship_trl.files.disk import read_file
from ship_trl.files.untrusted import read_yaml
from ship_trl.formats.maritime_schema import is_situation, read_situation
from ship_trl.formats.ntnu import is_scenario, read_scenario
from ship_trl.formats.situation import Ship, Situation
from ship_trl.sim import cases
from ship_trl.sim.cases import (
    MAX_TARGET_SHIPS,
    UNPERTURBED,
    Case,
    RecordedShip,
    Scale,
    Suite,
    TargetShip,
    check_case,
    find_case,
    is_suite,
    load_world,
    merge,
    to_heading,
)

# Not in the name of a folder or file.
UNNAMED = re.compile(r"[^\w.-]+")
# A situation of three ships has 5,000 bytes.
MAX_JSON_BYTES = 1_000_000
# Reasons of refusals that the closing line names.
MAX_REASONS = 3
# Of the way that own ship can go straight on in the time of an episode: the rest is for a detour.
USED = 0.7
# What stands for the ideal path, which nobody knows.
FOREIGN = "unknown"
# Where a file has no goal: metres ahead, as in the paper's cases.
GOAL_AHEAD = 600.0
# Metres around own ship in which other ships of AIS traffic belong to an encounter: the network's view.
WINDOW = 640.0
# An encounter as the scores of the rules count it: safe distances of DCPA, seconds of TCPA, safe distances.
ONSET, ONSET_TIME, CLEAR, USUAL_KNOTS = 4 / 3, 30.0, 2.0, 12.0
# A faster target ship is told: networks were trained with up to 1.5.
MAX_RATIO = 2.5
SUFFIXES = (".json", ".yaml", ".yml", ".csv", ".zip", ".zst", ".nmea", ".txt", ".log")


DEFAULT = Situations()


@dataclass(frozen=True)
class Changes:
    """Keys of the world, a suite's traffic, the perturbation and situations, other than in YAML files."""

    world: dict[str, Any] = field(default_factory=dict)
    traffic: dict[str, Any] = field(default_factory=dict)
    perturbation: Perturbation = UNPERTURBED
    situations: Situations = DEFAULT


@dataclass
class Report:
    """What became of a file or folder: cases, their situations by name, and what people should know."""

    cases: list[Case] = field(default_factory=list)
    situations: dict[str, Situation] = field(default_factory=dict)
    refused: list[str] = field(default_factory=list)
    notes: Counter[str] = field(default_factory=Counter)
    counts: Counter[str] = field(default_factory=Counter)

    def lines(self, world: World) -> list[str]:
        """Return the notes, and one closing line."""
        lines = [note if times == 1 else f"{note} ({times} times)" for note, times in self.notes.items()]
        reasons = "; ".join(self.refused[:MAX_REASONS]) + "; ..." * (len(self.refused) > MAX_REASONS)
        found = "".join(f"{n} {what}{'s' * (n != 1 and what.isalpha())}, " for what, n in self.counts.items())
        counts = f"{found}{counted(len(self.cases), 'scene')}, {len(self.refused)} refused"
        first = (
            f"; the first: {scale.describe(world)}" if self.cases and (scale := self.cases[0].scale) else ""
        )
        return [*lines, f"{counts}: {reasons}{first}" if reasons else f"{counts}{first}"]


def is_foreign(name: str) -> bool:
    """Return whether a name is the path of a file or folder of another tool, not of a case's YAML file."""
    path = Path(name)
    try:
        if path.is_dir():
            # A folder may have the name of a case or suite.
            return "/" in name or (not is_known(name) and holds_situations(path))
        if not path.is_file() or not is_read(path):
            return False
        if path.suffix.lower() in (".yaml", ".yml"):
            # A case's file is short; its keys are others.
            return bool(re.search(rb"^ship_list:", read_file(path), re.MULTILINE))
    except OSError:
        return False
    return True


def is_known(name: str) -> bool:
    """Return whether a name is that of a case or suite of ours, or empty."""
    return not name or is_suite(name) or find_case(name) is not None


def holds_situations(path: Path) -> bool:
    """Return whether a path is a folder with files whose names end as those of other tools do."""
    return path.is_dir() and any(is_read(one) and one.is_file() for one in path.iterdir())


def is_read(path: Path) -> bool:
    """Return whether a file's name ends as those of other tools do."""
    return path.suffix.lower() in SUFFIXES


def load_suite(
    name: str,
    world: World,
    key: str = "suite",
    perturbation: Perturbation = UNPERTURBED,
    reading: Situations = DEFAULT,
) -> Suite:
    """Read a suite or case by name or path as `ship_trl.sim.cases.load_suite` does, or a file of other tools.

    What there is to know about a file of other tools is written on stderr, once a process.

    Raises:
        ConfigError: no such suite, case or file, or nothing in it can be a case.
    """
    if not is_foreign(name):
        return cases.load_suite(name, world, key, perturbation)
    if reading.targets is Targets.replay and perturbation.ship_position + perturbation.ship_speed > 0:
        raise ConfigError(
            "perturbation: recorded ships start where their tracks do; allowed: situations.targets=straight, "
            "or own_position and own_heading alone"
        )
    report = read_cases(name, world, reading)
    for line in report.lines(world):
        tell(f"{name}: {line}")
    path = Path(os.path.abspath(name))  # noqa: PTH100 (links stay)
    own_name = path.name if path.is_dir() else stem(path)
    return Suite(re.sub(UNNAMED, "_", own_name), tuple(report.cases), perturbation)


def load_changed(name: str, config: object = None, world: World | None = None) -> tuple[Suite, World]:
    """Read a case or suite, and the world with which it begins, with the changes of a configuration.

    Args:
        name: as for `load_suite`.
        config: keys as on the command line and in a suite's file: `{"world": {"reward": {"goal": 100}},
            "traffic": {"ships": [0, 0, 1], "reacting": 0.5}, "perturbation": {"own_heading": 5},
            "situations": {"safe": 0.5}}`.
        world: what `world` changes; None for conf/world/paper.yaml.

    Raises:
        ConfigError: a key is unknown or wrong, or the suite has no traffic to change.
    """
    changes = read_as(Changes, {} if config is None else config, key="config")
    world = load_world(changes.world if world is None else merge(plain(world), changes.world, "world"))
    suite = load_suite(name, world, "case", changes.perturbation, changes.situations)
    if changes.traffic:
        if suite.traffic is None:
            allowed = "suite traffic, or another of random encounters"
            raise ConfigError(f"traffic: {cases.describe(name)} draws no ships; allowed: {allowed}")
        values = merge(plain(suite.traffic), changes.traffic, "traffic")
        suite = replace(suite, traffic=read_as(Traffic, values, key="traffic"))
    return suite, world


@cache
def tell(line: str) -> None:
    """Write a line on stderr, once a process."""
    print_error(line)


def read_cases(name: str, world: World, reading: Situations = DEFAULT) -> Report:
    """Read a file or folder of other tools as cases.

    A situation that cannot be a case is counted and left out, unless it is the only one.

    Raises:
        ConfigError: nothing can be read, or no case is left.
    """
    path, report = Path(name), Report()
    for situation in situations_of(path, world, reading, report):
        try:
            case = to_case(situation, world, reading, report.notes)
            check_case(case, world, situation.name)
        except (ValueError, ConfigError) as error:
            report.refused.append(str(error))
            continue
        # Of scenes of one name the later ones are numbered.
        names = chain([case.name], (f"{case.name}-{number}" for number in count(2)))
        case.name = next(name for name in names if name not in report.situations)
        report.cases.append(case)
        report.situations[case.name] = situation
    recorded = (ship for case in report.cases for ship in case.target_ships if isinstance(ship, RecordedShip))
    for number, ship in enumerate(recorded):
        ship.number = number
    if not report.cases:
        raise ConfigError(f"{name}: no scene is left; {report.lines(world)[-1]}")
    return report


def situations_of(path: Path, world: World, reading: Situations, report: Report) -> Iterator[Situation]:
    """Yield the situations of a file, or of all files of a folder in the order of their names."""
    files = [path]
    if path.is_dir():
        files = sorted(one for one in path.iterdir() if is_read(one) and not one.is_dir())
    if not files:
        raise ConfigError(f"{path}: has no file of situations; allowed: {', '.join(SUFFIXES)}")
    for file in files:
        try:
            yield from read_file_of(file, world, reading, report)
        except (ValueError, ConfigError, OSError, YAMLError) as error:
            text = " ".join(str(error).split())
            text = text if text.startswith(str(file)) else f"{file}: {text}"
            if len(files) == 1:
                raise ConfigError(text) from None
            report.refused.append(text)


def read_file_of(file: Path, world: World, reading: Situations, report: Report) -> Iterator[Situation]:
    """Yield the situations of a file, told by its content."""
    with file.open("rb") as opened:
        head = opened.read(4096)
    text = head.lstrip(b"\xef\xbb\xbf \t\r\n")
    if text.startswith((b"{", b"[")):
        try:
            values = json.loads(read_file(file, MAX_JSON_BYTES))
        except RecursionError:
            raise ValueError("nested too deep") from None
        found = values if isinstance(values, list) else [values]
        for number, one in enumerate(found):
            suffix = "" if len(found) == 1 else f"-{number + 1}"
            try:
                if not is_situation(one):
                    raise ValueError("is JSON without an ownShip; allowed: a traffic situation")
                situation = read_situation(one, f"{stem(file)}{suffix}")
            except ValueError as error:
                if len(found) == 1:
                    raise
                report.refused.append(f"{file}: [{number}]: {error}")
                continue
            yield situation
        return
    if file.suffix.lower() in (".yaml", ".yml"):
        scenario: Any = OmegaConf.to_container(read_yaml(file))
        if not is_scenario(scenario):
            raise ValueError("is YAML without a ship_list; allowed: a scenario of NTNU's simulator")
        yield read_scenario(scenario, stem(file))
        return
    yield from read_traffic(file, head, world, reading, report)


def read_traffic(
    file: Path, head: bytes, world: World, reading: Situations, report: Report
) -> Iterator[Situation]:
    """Yield the encounters of a table of AIS positions, or of NMEA sentences."""
    from ship_trl.formats import ais, tracks

    if re.search(rb"[!$]..VD[MO],", head):
        fixes = ais.read_nmea(file)
    elif ais.is_table(head) or file.suffix.lower() in (".csv", ".zip", ".zst"):
        fixes = ais.read_table(file)
    else:
        raise ValueError("is of no known format; allowed: a traffic situation, an NTNU scenario, AIS")
    length = reading.safe * NAUTICAL_MILE / world.safe_distance
    straight = world.actions[world.straight_action][0]
    time, way = length / (USUAL_KNOTS * KNOT / straight), straight * world.dt * world.max_steps
    safe = length * world.safe_distance
    # Where the scores of the rules take an encounter to begin and to end.
    limits = tracks.Limits(safe * ONSET, time * ONSET_TIME, safe * CLEAR, length * WINDOW, way * length)
    found = tracks.find_encounters(fixes, limits, reading.own, reading.ships)
    report.counts["pair"] += found.pairs
    report.counts["encounter"] += found.encounters
    if found.slow:
        report.counts["whose own ship makes less than 3 knots"] += found.slow
    if found.turned:
        report.notes[f"{found.turned} of {found.ships} target ships turned more than 10 degrees"] += 1
    yield from found.situations


def to_case(situation: Situation, world: World, reading: Situations, notes: Counter[str]) -> Case:
    """Return a situation as a case, with its scale.

    Raises:
        ValueError: it has too many target ships.
    """
    straight, _ = world.actions[world.straight_action]
    scale = Scale(
        reading.safe * NAUTICAL_MILE / world.safe_distance,
        situation.own.speed / straight,
        "" if situation.start is None else situation.start.isoformat(sep=" ", timespec="seconds"),
        situation.origin,
    )
    if len(situation.targets) > MAX_TARGET_SHIPS:
        raise ValueError(
            f"{situation.name}: has {len(situation.targets)} target ships; allowed: {MAX_TARGET_SHIPS}"
        )
    ships: list[TargetShip] = []
    for ship in situation.targets:
        speed = ship.speed / scale.speed
        start = ship.x / scale.length, ship.y / scale.length, to_heading(ship.course), speed
        if reading.targets is Targets.replay and ship.track is not None:
            ships.append(RecordedShip(*start, path=path_of(ship, scale, world)))
        else:
            ships.append(TargetShip(*start))
        if speed > MAX_RATIO * straight:
            notes[f"a target ship is more than {MAX_RATIO:g} times as fast as own ship"] += 1
    if not ships:
        notes["a situation has no target ship"] += 1
    course = math.radians(situation.own.course)
    x, y = situation.goal or (math.sin(course), math.cos(course))
    # As far as own ship gets with some steps left for a detour; without a goal, as in the paper's cases.
    most = USED * (straight * world.dt * world.max_steps + world.goal_distance)
    away = math.hypot(x, y)
    distance = GOAL_AHEAD if situation.goal is None else min(away / scale.length, most)
    if situation.goal is not None and away / scale.length > most:
        notes["own ship's goal lies farther away than an episode lasts; it is moved nearer"] += 1
    goal = [x / away * distance, y / away * distance]
    for note in situation.notes:
        notes[note] += 1
    name = re.sub(UNNAMED, "_", situation.name)[:80]
    return Case(
        [0.0, 0.0],
        to_heading(situation.own.course),
        goal,
        FOREIGN,
        ships,
        name,
        scale,
        path_of(situation.own, scale, world),
    )


def path_of(ship: Ship, scale: Scale, world: World) -> tuple[tuple[float, float], ...]:
    """Return where a ship was (m, of the simulator's size) after each step, as long as its track is known."""
    if ship.track is None:
        return ()
    seconds, x, y = ship.track.T
    times = np.arange(1, world.max_steps + 1) * world.dt * scale.time
    times = times[times <= seconds[-1]]
    places = np.stack((np.interp(times, seconds, x), np.interp(times, seconds, y)), -1) / scale.length
    return tuple((float(east), float(north)) for east, north in places)
