"""Read policies and suites from a command line, the same way for `evaluate`, `watch` and `record`.

POLICY is what `policies.registry.kind_of` knows, or a result folder. Result folders and `pretrained` have
their own target. Every other policy needs `target=CASE`, which may be a suite, or takes the targets of the
policies before it. It acts in the world of the first result folder or, without one, in the paper's with
`world.KEY=VALUE`. `perturbation.KEY=VALUE` perturbs the starts.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from yaml import YAMLError

from ship_trl.config.errors import ConfigError, print_error
from ship_trl.config.schema import read_as
from ship_trl.config.types import Changes, Perturbation, Situations, World, plain
from ship_trl.files.record import RESULT
from ship_trl.files.untrusted import read_changes
from ship_trl.foreign.suites import load_suite
from ship_trl.policies.pretrained import PRETRAINED, Pretrained, find, is_pretrained, networks
from ship_trl.policies.registry import Entry, kind_of, split_masks
from ship_trl.run.plan import read_settings
from ship_trl.run.results import collect, locate
from ship_trl.sim.cases import Suite, load_world
from ship_trl.transfer.casebase import POLICY, POLICY_LAST


def find_entries(words: list[str], colour: bool) -> list[Entry]:
    """Read the policies that a command line names, each with its target case.

    Raises:
        ConfigError: an unknown word, a folder without a result, or a policy without a target.
    """
    # A path may contain an equals sign, for example seed=0.
    names = [w for w in words if not re.match(r"[\w.]+=", w) or Path(w.rpartition(":")[0] or w).exists()]
    given = find_targets([word for word in words if word not in names])
    split = [split_masks(name) for name in names]
    names = [name for name, _ in split]
    if not names:
        raise ConfigError("policy: none given; for example pretrained:traffic; --help lists all")
    folders = [name for name in names if not is_pretrained(name) and Path(name).is_dir()]
    if folders and given.changes.world:
        raise ConfigError("world: a result folder has its own; allowed with other policies: world.KEY")
    trained = {name: folder_entries(Path(name), given) for name in folders}
    # Runs of two folders may have the same name.
    labels = Counter(label for runs in trained.values() for label in {one.label for one in runs})
    world = next(iter(trained.values()))[0].world if trained else given.world
    targets, entries = given.suites(world), list[Entry]()
    for name, masks in split:
        if is_pretrained(name):
            found = bundled_entries(name, targets, world, given.changes.perturbation)
        elif name in trained:
            found = [
                replace(one, label=f"{name}: {one.label}") if labels[one.label] > 1 else one
                for one in trained[name]
            ]
        else:
            own = targets or list({one.suite.fingerprint: one.suite for one in entries}.values())
            found = named_entries(name, own, world, colour)
        entries += [one.masked(masks) for one in found]
    given.check_reading([entry.suite for entry in entries])
    return entries


@dataclass
class Given:
    """What words such as target=CASE and situations.KEY=VALUE say; `reading` are keys of the latter."""

    names: list[str]
    world: World
    changes: Changes
    reading: dict[str, Any]
    _loaded: list[tuple[World, list[Suite]]] = field(default_factory=list)

    def suites(self, world: World) -> list[Suite]:
        """Load the targets in a world, once: a file of another tool gets its scale from it.

        Raises:
            ConfigError: a target cannot be read.
        """
        for other, known in self._loaded:
            if other == world:
                return known
        bounds, reading = self.changes.perturbation, self.changes.situations
        found = [load_suite(name, world, "target", bounds, reading) for name in self.names]
        self._loaded.append((world, found))
        return found

    def check_reading(self, suites: Sequence[Suite]) -> None:
        """Check that keys of reading mean something.

        Raises:
            ConfigError: no suite is a file of another tool.
        """
        if self.reading and not any(case.scale for suite in suites for case in suite.cases):
            key = f"situations.{next(iter(self.reading))}"
            raise ConfigError(f"{key}: no target is a file of another tool; allowed with target=FILE|FOLDER")


def find_targets(
    words: list[str], groups: Sequence[str] = ("perturbation", "world", "situations"), default: str = ""
) -> Given:
    """Read the words of a command line that say what to act in: target=CASE, and keys of some groups.

    Without a target it is `default`, if there is one.

    Raises:
        ConfigError: a word is no such key, or a value is wrong.
    """
    targets = [word.removeprefix("target=") for word in words if word.startswith("target=")]
    keys = [word for word in words if not word.startswith("target=")]
    for word in keys:
        if not re.match(rf"({'|'.join(groups)})\.\w", word):
            allowed = ", ".join(("target", *(f"{group}.KEY" for group in groups)))
            raise ConfigError(f"{word.partition('=')[0]}: unknown key; allowed here: {allowed}")
    if len(targets) > 1:
        raise ConfigError("target: given twice; allowed: target=CASE once, with commas between several cases")
    try:
        values = read_changes(keys)
        changes = read_as(Changes, values)
    except YAMLError as error:
        given = ", ".join(word.partition("=")[0] for word in keys)
        raise ConfigError(f"{given}: not readable: {' '.join(str(error).split())}") from None
    world = load_world(changes.world)
    # Without a default there may be no suite.
    names = [name for name in (targets or [default])[0].split(",") if name or default]
    return Given(names, world, changes, dict(values.get("situations", {})))


def find_suites(words: list[str], default: str) -> tuple[list[str], list[Suite], World]:
    """Return the targets of a command line that names no policies: names, suites and their world."""
    given = find_targets(words, ("situations",), default)
    suites = given.suites(given.world)
    given.check_reading(suites)
    return given.names, suites, given.world


def named_entries(name: str, suites: list[Suite], world: World, colour: bool) -> list[Entry]:
    """Return a policy without results on each suite.

    Raises:
        ConfigError: there is no such policy, or no suite.
    """
    kind_of(name, ["a result folder"])
    if not suites:
        raise ConfigError(
            f"target: none given for {name}; allowed: target=CASE, with commas between several cases"
        )
    return [Entry(name, name, suite, world, colour) for suite in suites]


def bundled_entries(name: str, targets: list[Suite], world: World, perturbation: Perturbation) -> list[Entry]:
    """Return the bundled networks, on `targets` or each on its own, with the return that each claims."""
    if targets:
        chosen = [(find(name, suite if name == PRETRAINED else None), suite) for suite in targets]
    else:
        named: Sequence[Pretrained] = networks() if name == PRETRAINED else [find(name, None)]
        chosen = [(one, load_suite(one.target, world, "target", perturbation)) for one in named]
    is_paper = world == load_world()
    return [
        Entry(str(one.file), name, suite, world, colour=False, claimed=one.claim(suite) if is_paper else None)
        for one, suite in chosen
    ]


def folder_entries(folder: Path, given: Given) -> list[Entry]:
    """Return the networks of all results in a folder and below, on the given targets or on their own target.

    Keys of reading change those with which a run read its own target. Where they do, or starts are perturbed,
    no return is claimed: the run was evaluated on others.
    """
    found, changes = list[Entry](), given.changes
    for run in collect(folder):
        place = run.folder
        world, colour, trained, reading = read_settings(place)
        bounds = trained if changes.perturbation.is_none else changes.perturbation
        reading = read_as(Situations, plain(reading) | given.reading)
        target = f"{place / RESULT}: target"
        suites = given.suites(world) or [
            load_suite(locate(run.target, place), world, target, bounds, reading)
        ]
        is_other = bool(given.names or given.reading)
        label = f"{run.label} {run.name} seed {run.seed}"
        for file, key, claim in ((POLICY, "best", run.best), (POLICY_LAST, "final", run.final)):
            if not (place / file).is_file():
                print_error(f"{place / file} is missing; left out")
                continue
            claimed = None if is_other or suites[0].is_drawn else claim.episode_return
            name = f"{label}, {key}"
            found += [Entry(str(place / file), name, suite, world, colour, claimed) for suite in suites]
    if not found:
        raise ConfigError(f"policy: no {RESULT} with its networks at or below {folder}")
    return found


def drop_last_networks(entries: list[Entry]) -> list[Entry]:
    """Drop the last network of each result folder, but keep files that the command line names."""
    best = [e for e in entries if e.label == e.policy or Path(split_masks(e.policy)[0]).name != POLICY_LAST]
    if not best:
        raise ConfigError(f"policy: {entries[0].policy} is a last network; {POLICY} is missing")
    return best
