"""study.json: the settings and jobs of a study, so that no run of other settings is mixed in."""

from __future__ import annotations

import dataclasses
import json
import os
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any

from hydra import compose, initialize_config_dir
from hydra.core.global_hydra import GlobalHydra

from ship_trl.config.checks import to_config
from ship_trl.config.errors import ConfigError
from ship_trl.config.hydra import explain_hydra
from ship_trl.config.network import non_default_network
from ship_trl.config.paths import conf_dir
from ship_trl.config.schema import Rule, read_as
from ship_trl.config.types import Config, World, plain
from ship_trl.files.disk import atomic_write, read_json
from ship_trl.sim.cases import load_case
from ship_trl.study.plan.config import StudyConfig
from ship_trl.study.plan.jobs import PAIRS, Job, PlannedJob
from ship_trl.study.rules import stamp

PLAN = "study.json"
# The rules that a study was begun with (`rules.stamp`); old studies have none.
STAMP = {"digest", "commit", "begun"}
Stamp = Annotated[
    dict[str, Any], Rule("a group of digest, commit, begun", lambda rules: not rules or rules.keys() >= STAMP)
]
Seeds = Annotated[list[int], Rule("a list of seeds", bool)]


@dataclass(frozen=True)
class Plan:
    """The parts of a study.json that are read again; old ones have neither judged seeds nor rules."""

    settings: dict[str, Any]
    cases: dict[str, str]
    jobs: list[PlannedJob]
    judged: Seeds = field(default_factory=list)
    rules: Stamp = field(default_factory=dict)


@dataclass(frozen=True)
class Manifest:
    """What a report needs of a study.json; empty where a folder has none.

    Only the seeds that the study was begun with are judged. No run learns before `warmup` episodes are over.
    `folders` are those of the planned runs, with their seeds.
    """

    seeds: tuple[int, ...] = ()
    rules: dict[str, Any] = field(default_factory=dict)
    cases: dict[str, str] = field(default_factory=dict)
    warmup: int = 0
    folders: dict[Path, int] = field(default_factory=dict)


def run_config(config: StudyConfig) -> Config:
    """Compose and check the configuration that all runs share.

    Raises:
        ConfigError: a wrong override.
    """
    from hydra.errors import HydraException

    GlobalHydra.instance().clear()
    try:
        with initialize_config_dir(str(conf_dir()), version_base="1.3"):
            line = ["target=1", "method=scratch", f"profile={config.profile}", *config.run_overrides]
            return to_config(compose("config", overrides=line))
    except HydraException as error:
        raise ConfigError(f"overrides: {explain_hydra(error).removeprefix('overrides: ')}") from None


def fingerprints(jobs: list[Job], world: World) -> dict[str, str]:
    """Return the fingerprint of each case of a study, by name: a case file may be edited later."""
    cases = {str(job.values[key]) for job in jobs for key in ("source", "target") if job.values.get(key)}
    return {name: load_case(name, world).fingerprint for name in sorted(cases)}


def write_plan(jobs: list[Job], config: StudyConfig) -> None:
    """Make the study's folder and write study.json; more seeds or arms may be added later.

    Raises:
        ConfigError: the folder cannot be written, or holds a study of other settings.
    """
    shared = run_config(config)
    settings = settings_of(jobs, config, shared)
    cases = fingerprints(jobs, shared.world)
    path = config.folder / PLAN
    begun = read_plan(path, "output") if path.exists() else {}
    before, known = begun.get("settings", settings), begun.get("cases", {})
    keys = sorted(settings.keys() | before.keys())
    differ = [key for key in keys if settings.get(key) != before.get(key)]
    differ += [f"case {name}" for name in cases if known.get(name, cases[name]) != cases[name]]
    if differ:
        holds = f"output: {config.folder} holds a study of other settings ({', '.join(differ)})"
        raise ConfigError(f"{holds}; allowed: another output=FOLDER")
    plan = {
        "settings": settings,
        "cases": known | cases,
        # The seeds and rules that the study was begun with stay, even if more is added.
        "judged": begun.get("judged", list(config.numbers)),
        "rules": begun.get("rules", stamp()),
        "jobs": [dataclasses.asdict(job) for job in jobs],
    }
    try:
        config.folder.mkdir(parents=True, exist_ok=True)
        if not os.access(config.folder, os.W_OK | os.X_OK):
            raise PermissionError(13, "Permission denied")
        with atomic_write(path) as draft:
            draft.write_text(json.dumps(plan, indent=1))
    except OSError as error:
        raise ConfigError(f"output: {config.folder} cannot be written: {error.strerror}") from None


def settings_of(jobs: list[Job], config: StudyConfig, shared: Config) -> dict[str, Any]:
    """Return the settings that all runs of a study must share.

    Raises:
        ConfigError: an arm has more layers than the network.
    """
    most = max((job.values["layers"] for job in jobs if type(job.values.get("layers")) is int), default=0)
    if most > len(shared.network.conv):
        wanted = f"overrides: network has {len(shared.network.conv)} conv layers, and arms have up to {most}"
        raise ConfigError(f"{wanted}; allowed: arms=[...] of fewer layers")
    learn = plain(shared.learn)
    # Like the device, the backend changes no result: a study may go on with another one.
    del learn["backend"]
    settings: dict[str, Any] = {
        "profile": config.profile,
        "first_seed": config.first_seed,
        "learn": learn,
        "world": plain(shared.world),
        "colour": shared.colour,
    }
    if (network := non_default_network(shared.network)) is not None:
        settings["network"] = network
    return settings


def read_plan(path: Path, key: str) -> dict[str, Any]:
    """Read a study.json and check the parts that every study has.

    Args:
        path: of the file.
        key: the argument that named the folder, for messages.

    Raises:
        ConfigError: there is no file, or it is not a study's plan.
    """
    try:
        plan: dict[str, Any] = read_json(path)
    except FileNotFoundError:
        raise ConfigError(f"{key}: no {path}, the plan that a study has") from None
    except (OSError, ValueError):
        raise ConfigError(f"{key}: {path} is not a study's plan") from None
    read_as(Plan, plan, f"{key}: {path} is not a study's plan: ", from_json=True)
    return plan


def read_manifest(folder: Path) -> Manifest:
    """Read the study.json of a folder; an empty manifest where there is no file.

    Raises:
        ConfigError: the file is damaged. Without its seeds nobody knows when claims are judged.
    """
    path = folder / PLAN
    if not path.exists():
        return Manifest()
    plan = read_as(Plan, read_plan(path, "folder"), from_json=True)
    seeds = plan.judged or [job.seed for job in plan.jobs if job.part == PAIRS]
    if not seeds:
        raise ConfigError(f"folder: {path} is not a study's plan: it has no seed")
    return Manifest(
        tuple(sorted(set(seeds))),
        plan.rules,
        plan.cases,
        warmup_episodes(plan.settings),
        {job.folder(folder): job.seed for job in plan.jobs},
    )


def warmup_episodes(settings: dict[str, Any]) -> int:
    """Return after how many episodes runs learn at the earliest; 0 where the settings do not say it."""
    try:
        return max(0, int(settings["learn"]["warmup_steps"] // settings["world"]["max_steps"]))
    except (KeyError, TypeError, ValueError, ArithmeticError):
        return 0
