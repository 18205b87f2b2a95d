"""A file or folder of other tools as a suite: each of its situations is a case of the simulator's size."""

from __future__ import annotations

import os
import re
from collections import Counter, defaultdict
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from functools import cache
from itertools import chain, count
from pathlib import Path

from yaml import YAMLError

from ship_trl.config.bounds import KNOT, NAUTICAL_MILE
from ship_trl.config.errors import ConfigError, counted, print_error
from ship_trl.config.paths import stem
from ship_trl.config.schema import read_as
from ship_trl.config.types import Changes, Perturbation, Situations, Targets, Traffic, World, plain
from ship_trl.files.disk import read_file, read_json
from ship_trl.files.untrusted import MAX_YAML_BYTES, read_yaml
from ship_trl.foreign.cases import UNNAMED, to_case
from ship_trl.formats.maritime_schema import read_situation
from ship_trl.formats.ntnu import read_scenario
from ship_trl.formats.situation import Situation
from ship_trl.sim import cases
from ship_trl.sim.cases import Case, RecordedShip, Suite

# A situation of three ships has 5,000 bytes.
MAX_JSON_BYTES = 1_000_000
# Reasons of refusals that the closing line names.
MAX_REASONS = 3
# Scenes that a refusal names.
MAX_NAMES = 8
# Metres around own ship in which other ships of AIS traffic belong to an encounter: the network's view.
WINDOW = 640.0
# An encounter as the scores of the rules count it: safe distances of DCPA, seconds of TCPA, safe distances.
# Below `SOONEST` seconds of TCPA, 4 minutes at 12 knots, a track that begins leaves no time to act.
ONSET, ONSET_TIME, SOONEST, CLEAR, USUAL_KNOTS = 4 / 3, 30.0, 8.0, 2.0, 12.0
SUFFIXES = (".json", ".yaml", ".yml", ".csv", ".zip", ".zst", ".nmea", ".txt", ".log")
DEFAULT = Situations()
# What there is to know is said once a process.
tell = cache(print_error)


@dataclass
class Report:
    """What became of the file or folder `name`: cases, and what people should know."""

    name: str
    cases: list[Case] = field(default_factory=list)
    refused: list[str] = field(default_factory=list)
    notes: defaultdict[str, list[str]] = field(default_factory=lambda: defaultdict(list))
    counts: Counter[str] = field(default_factory=Counter)

    @contextmanager
    def refusing(self, where: str) -> Iterator[None]:
        """Count what cannot be read, with the reason in one line that begins with `where`."""
        try:
            yield
        except (ValueError, OverflowError, RecursionError, ConfigError, OSError, YAMLError) as error:
            text = " ".join(str(error).split())
            self.refused.append(text if text.startswith(where) else f"{where}: {text}")

    def within(self, where: str) -> str:
        """Return a place or line without the name of the whole file or folder."""
        return where.removeprefix(self.name).lstrip(":/ ")

    def lines(self, world: World) -> list[str]:
        """Return the notes, each with the first place that it is of, and one closing line."""
        lines = []
        for note, places in self.notes.items():
            times = f"{len(places)} times, first in " if len(places) > 1 else "in "
            first = self.within(places[0])
            lines.append(f"{note} ({times}{first})" if first else note)
        reasons = "; ".join(map(self.within, self.refused[:MAX_REASONS]))
        reasons += "; ..." * (len(self.refused) > MAX_REASONS)
        found = "".join(f"{n} {what}{'s' * (n != 1 and what.isalpha())}, " for what, n in self.counts.items())
        closing = f"{found}{counted(len(self.cases), 'scene')}, {len(self.refused)} refused"
        if reasons:
            closing += f": {reasons}"
        if self.cases and (scale := self.cases[0].scale):
            closing += f"; the first: {scale.describe(world)}"
        return [*lines, closing]


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
            return bool(re.search(rb"^ship_list:", read_file(path, MAX_YAML_BYTES), re.MULTILINE))
    except OSError:
        return False
    return True


def is_known(name: str) -> bool:
    """Return whether a name is that of a case or suite of ours, or empty."""
    return not name or cases.is_suite(name) or cases.find_case(name) is not None


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
    perturbation: Perturbation = cases.UNPERTURBED,
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
    world = cases.load_world(
        changes.world if world is None else cases.merge(plain(world), changes.world, "world")
    )
    suite = load_suite(name, world, "case", changes.perturbation, changes.situations)
    if changes.traffic:
        if suite.traffic is None:
            allowed = "suite traffic, or another of random encounters"
            raise ConfigError(f"traffic: {cases.describe(name)} draws no ships; allowed: {allowed}")
        values = cases.merge(plain(suite.traffic), changes.traffic, "traffic")
        suite = replace(suite, traffic=read_as(Traffic, values, key="traffic"))
    return suite, world


def read_cases(name: str, world: World, reading: Situations = DEFAULT) -> Report:
    """Read a file or folder of other tools as cases; what cannot be a case is counted and left out.

    Raises:
        ConfigError: no case is left.
    """
    path, report, taken = Path(name), Report(name), set[str]()
    files = [path]
    if path.is_dir():
        files = sorted(one for one in path.iterdir() if is_read(one) and not one.is_dir())
    if not files:
        raise ConfigError(f"{path}: has no file of situations; allowed: {', '.join(SUFFIXES)}")
    for file in files:
        with report.refusing(str(file)):
            for situation in situations_of(file, world, reading, report):
                where = str(file) if situation.name == stem(file) else f"{file}: {situation.name}"
                with report.refusing(where):
                    notes = list(situation.notes)
                    case = to_case(situation, world, reading, notes)
                    cases.check_case(case, world, where)
                    for note in notes:
                        report.notes[note].append(where)
                    # Of scenes of one name the later ones are numbered.
                    names = chain([case.name], (f"{case.name}-{number}" for number in count(2)))
                    case.name = next(name for name in names if name not in taken)
                    taken.add(case.name)
                    report.cases.append(case)
    if reading.scene and report.cases:
        known = [case.name for case in report.cases]
        report.cases = [case for case in report.cases if case.name == reading.scene]
        if not report.cases:
            allowed = ", ".join(known[:MAX_NAMES]) + ", ..." * (len(known) > MAX_NAMES)
            raise ConfigError(f"situations.scene: {name} has no scene {reading.scene}; allowed: {allowed}")
    recorded = (ship for case in report.cases for ship in case.target_ships if isinstance(ship, RecordedShip))
    for number, ship in enumerate(recorded):
        ship.number = number
    if not report.cases:
        told = "; ".join(report.lines(world))
        raise ConfigError(
            report.refused[0] if len(report.refused) == 1 else f"{name}: no scene is left; {told}"
        )
    return report


def situations_of(file: Path, world: World, reading: Situations, report: Report) -> Iterator[Situation]:
    """Yield the situations of a file, told by its content; those of a list are refused one by one."""
    with file.open("rb") as opened:
        head = opened.read(4096)
    if head.lstrip(b"\xef\xbb\xbf \t\r\n").startswith((b"{", b"[")):
        values = read_json(file, MAX_JSON_BYTES)
        found = values if isinstance(values, list) else [values]
        for number, one in enumerate(found):
            is_only = len(found) == 1
            with report.refusing(str(file) if is_only else f"{file}: [{number}]"):
                yield read_situation(one, stem(file) if is_only else f"{stem(file)}-{number + 1}")
    elif file.suffix.lower() in (".yaml", ".yml"):
        yield read_scenario(read_yaml(file), stem(file))
    else:
        yield from read_traffic(file, head, world, reading, report)


def read_traffic(
    file: Path, head: bytes, world: World, reading: Situations, report: Report
) -> Iterator[Situation]:
    """Yield the encounters of a table of AIS positions, or of NMEA sentences.

    Raises:
        ValueError: it has no position of a ship, or courses contradict positions.
    """
    from ship_trl.foreign import tracks
    from ship_trl.formats import ais, nmea

    fixes = nmea.read_nmea(file) if re.search(rb"[!$]..VD[MO],", head) else ais.read_table(file)
    if not len(fixes.ship):
        raise ValueError(
            "has no row of a ship with an MMSI (2 to 7 first, nine digits), class A or B where classes "
            "stand, a time, and a position with decimal points"
        )
    if not tracks.follow_courses(fixes):
        raise ValueError("most courses contradict the positions; are latitude and longitude swapped?")
    length = reading.safe * NAUTICAL_MILE / world.safe_distance
    straight = world.actions[world.straight_action][0]
    time, way = length / (USUAL_KNOTS * KNOT / straight), straight * world.dt * world.max_steps
    safe = length * world.safe_distance
    # Where the scores of the rules take an encounter to begin and to end.
    limits = tracks.Limits(
        safe * ONSET, time * ONSET_TIME, safe * CLEAR, length * WINDOW, way * length, time * SOONEST
    )
    found = tracks.find_encounters(fixes, limits, reading.own, reading.ships)
    report.counts["pair"] += found.pairs
    report.counts["encounter"] += found.encounters
    if not found.encounters:
        limit = f"a DCPA below {limits.dcpa / NAUTICAL_MILE:.2f} NM in {limits.tcpa / 60:.0f} minutes or less"
        report.notes[f"has no encounter, which is {limit} (situations.safe scales both)"].append(str(file))
    if found.slow:
        report.counts["whose own ship makes less than 3 knots"] += found.slow
    if found.late:
        report.counts[f"seen less than {time * SOONEST / 60:.0f} minutes before CPA"] += found.late
    if found.turned:
        report.notes[f"{found.turned} of {found.ships} target ships turned more than 10 degrees"].append(
            str(file)
        )
    yield from found.situations
