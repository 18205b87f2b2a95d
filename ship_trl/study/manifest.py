"""study.json: the settings and jobs of a study, so that no run of other settings is mixed in."""

from __future__ import annotations

import hashlib
import json
import subprocess
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Annotated, Any

from ship_trl.config.checks import named_learn, non_default_algorithm, reads_of
from ship_trl.config.errors import ConfigError
from ship_trl.config.network import non_default_network
from ship_trl.config.schema import read_as, rule
from ship_trl.config.types import Config, world_values
from ship_trl.files.disk import atomic_write, read_json
from ship_trl.grid.compose import compose_config
from ship_trl.sim.cases import load_suite
from ship_trl.study.plan import PAIRS, Job, StudyConfig

PLAN = "study.json"
STAMP = {"digest", "commit", "begun"}
Stamp = Annotated[
    dict[str, Any], rule("a group of digest, commit, begun", lambda rules: not rules or rules.keys() >= STAMP)
]
Seeds = Annotated[list[int], rule("a list of seeds", bool)]


@dataclass(frozen=True)
class Plan:
    """What was planned, as in a study.json; empty for a folder without one.

    `rules` are those of the beginning (see `stamp`), `question` and `words` those of the last start's
    `StudyConfig`; `kept` are digests of the tables of a copy, by name.
    """

    settings: dict[str, Any]
    cases: dict[str, str]
    jobs: list[Job]
    judged: Seeds = field(default_factory=list)
    rules: Stamp = field(default_factory=dict)
    question: Annotated[str, rule("one line of plain text", str.isprintable)] = ""
    words: list[str] = field(default_factory=list)
    kept: dict[str, str] = field(default_factory=dict)

    @property
    def seeds(self) -> tuple[int, ...]:
        """The seeds that are judged: those that the study was begun with."""
        return tuple(sorted({*(self.judged or (job.seed for job in self.jobs if job.part == PAIRS))}))

    @property
    def warmup(self) -> int:
        """The number of first episodes in which no run learns."""
        try:
            algorithm = self.settings.get("algorithm")
            has_replay = algorithm is None or not reads_of(algorithm).is_on_policy
            steps = self.settings["learn"]["warmup_steps"] if has_replay else 0
            return max(0, int(steps // self.settings["world"]["max_steps"]))
        except (KeyError, TypeError, ValueError, ArithmeticError):
            return 0

    def to_json(self, indent: int | None = None) -> str:
        """Return the text of a study.json, without what is empty."""
        jobs = [{key: value for key, value in vars(job).items() if value != {}} for job in self.jobs]
        values = {key: value for key, value in vars(self).items() if value}
        return json.dumps(values | {"jobs": jobs}, indent=indent)


NO_PLAN = Plan({}, {}, [])


def run_config(config: StudyConfig) -> Config:
    """Compose and check the configuration that all runs of a study share.

    Raises:
        ConfigError: an override is wrong.
    """
    # Without those of Hydra and its launcher.
    overrides = [line for line in config.overrides if not line.startswith("hydra.")]
    try:
        return compose_config("target=1", "method=scratch", f"profile={config.profile}", *overrides)
    except ConfigError as error:
        raise ConfigError(f"overrides: {str(error).removeprefix('overrides: ')}") from None


def write_plan(jobs: list[Job], config: StudyConfig, rules: Sequence[Path] = ()) -> None:
    """Make the study's folder and write study.json; more seeds or arms may be added later.

    `rules` are the files that say how the study is judged.

    Raises:
        ConfigError: the folder cannot be written, or holds a study with other settings.
    """
    shared = run_config(config)
    settings = shared_settings(jobs, config, shared)
    names = {str(job.values[key]) for job in jobs for key in ("source", "target") if job.values.get(key)}
    # A case file may be edited later.
    cases = {name: load_suite(name, shared.world, "pairs").fingerprint for name in sorted(names)}
    path = config.folder / PLAN
    # Seeds that are added later are not judged, and the rules stay those of the beginning.
    begun = (
        read_plan(path, "output")
        if path.exists()
        else Plan(settings, {}, [], list(config.numbers), stamp(rules))
    )
    keys = sorted(settings.keys() | begun.settings.keys())
    differ = [key for key in keys if settings.get(key) != begun.settings.get(key)]
    differ += [f"case {name}" for name in cases if begun.cases.get(name, cases[name]) != cases[name]]
    if differ:
        raise ConfigError(
            f"output: {config.folder} holds a study with other settings ({', '.join(differ)}); "
            "allowed: another output=FOLDER"
        )
    plan = replace(begun, settings=settings, cases=begun.cases | cases, jobs=jobs)
    plan = replace(plan, question=config.question, words=config.words)
    try:
        config.folder.mkdir(parents=True, exist_ok=True)
        with atomic_write(path) as draft:
            draft.write_text(plan.to_json(indent=1))
    except OSError as error:
        raise ConfigError(f"output: {config.folder} cannot be written: {error.strerror}") from None


def shared_settings(jobs: list[Job], config: StudyConfig, shared: Config) -> dict[str, Any]:
    """Return the settings that all runs of a study must share.

    Raises:
        ConfigError: an arm has more layers than the network.
    """
    depth = shared.network.depth
    for job in jobs:
        layers = job.values.get("layers")
        if type(layers) is int and layers > depth:
            least, most = (job.arm.replace(str(layers), str(number)) for number in (1, depth))
            raise ConfigError(
                f"arms: {job.arm} copies {layers} layers, the network has {depth}; allowed: {least} to {most}"
            )
    settings = {
        "profile": config.profile,
        "first_seed": config.first_seed,
        "learn": named_learn(shared.learn),
        "world": world_values(shared.world),
        "colour": shared.colour,
    }
    if network := non_default_network(shared.network):
        settings["network"] = network
    if algorithm := non_default_algorithm(shared.algorithm):
        settings["algorithm"] = algorithm
    return settings


def read_plan(path: Path, key: str) -> Plan:
    """Read a study.json; messages begin with `key`.

    Raises:
        ConfigError: the file is missing, or is not a study's plan.
    """
    try:
        values = read_json(path)
    except (OSError, ValueError):
        state = "is not a study's plan" if path.exists() else "is missing; every study has this plan"
        raise ConfigError(f"{key}: {path} {state}") from None
    return read_as(Plan, values, f"{key}: {path} is not a study's plan: ", from_json=True)


def load_plan(folder: Path) -> Plan:
    """Read the study.json of a folder; return an empty plan if there is no file.

    Raises:
        ConfigError: the file is damaged. Without its seeds it is unknown when claims are judged.
    """
    path = folder / PLAN
    if not path.exists():
        return NO_PLAN
    plan = read_plan(path, "folder")
    if not plan.seeds:
        raise ConfigError(f"folder: {path} is not a study's plan: it has no seeds")
    return plan


def digest(rules: Sequence[Path]) -> str | None:
    """Return the SHA-256 of the files with the rules; None if one is missing."""
    if not all(path.is_file() for path in rules):
        return None
    return hashlib.sha256(b"".join(path.read_bytes() for path in rules)).hexdigest()


def stamp(rules: Sequence[Path]) -> dict[str, Any]:
    """Return digest and commit of the rules and the present time; nothing without rules."""
    now = datetime.now(UTC).isoformat(timespec="seconds")
    return {"digest": digest(rules), "commit": last_commit(rules), "begun": now} if rules else {}


def last_commit(rules: Sequence[Path]) -> str | None:
    """Return commit and time of the last change of the rules; None if unknown or not committed."""

    def git(*words: str) -> str:
        line = ["git", "-C", str(rules[0].parent), *words, "--", *map(str, rules)]
        return subprocess.run(line, capture_output=True, text=True, check=True, timeout=10).stdout.strip()

    try:
        return None if git("status", "--porcelain") else git("log", "-1", "--format=%H of %cI") or None
    except (OSError, subprocess.SubprocessError):
        return None


def describe_rules(begun: Mapping[str, Any], rules: Sequence[Path]) -> str:
    """Say by which rules a study is judged, and whether they have changed since it was begun."""
    if not begun or not rules:
        return "No plan was kept with these runs, so nothing shows that the rules are older than the runs."
    commit = "no commit" if begun["commit"] is None else f"commit {begun['commit']}"
    words = f"Rules: {'/'.join(rules[0].parts[-3:])}, {commit}; the study was begun at {begun['begun']}."
    if digest(rules) != begun["digest"]:
        words += " The text has changed since; that commit has it as it was when the study was begun."
    return words
