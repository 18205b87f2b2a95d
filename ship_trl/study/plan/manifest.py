"""What a study's folder was begun with, so that nothing else is mixed in."""

from __future__ import annotations

import dataclasses
import json
import os
from pathlib import Path
from typing import Any

from hydra import compose, initialize_config_dir
from hydra.core.global_hydra import GlobalHydra

from ship_trl.config.checks import to_config
from ship_trl.config.errors import ConfigError
from ship_trl.config.hydra import explain_hydra
from ship_trl.config.network import non_default_network
from ship_trl.config.paths import conf_dir
from ship_trl.config.types import Config, World, plain
from ship_trl.files.disk import read_json, replacing
from ship_trl.sim.cases import load_case
from ship_trl.study.plan.config import StudyConfig
from ship_trl.study.plan.jobs import PAIRS, Job
from ship_trl.study.rules import stamp

PLAN = "study.json"
# What names a job.
JOB = ("name", "stage", "part", "label", "arm", "seed")


def run_config(config: StudyConfig) -> Config:
    """Compose the configuration that all runs share, checked.

    Raises:
        ConfigError: an override that is not right.
    """
    from hydra.errors import HydraException

    GlobalHydra.instance().clear()
    try:
        with initialize_config_dir(str(conf_dir()), version_base="1.3"):
            line = ["target=1", "method=scratch", f"profile={config.profile}", *config.of_runs]
            return to_config(compose("config", overrides=line))
    except HydraException as error:
        raise ConfigError(f"overrides: {explain_hydra(error).removeprefix('overrides: ')}") from None


def episodes_of(config: StudyConfig) -> int:
    """Training episodes of a run."""
    return run_config(config).learn.episodes


def fingerprints(jobs: list[Job], world: World) -> dict[str, str]:
    """Say what each case of a study is, by name: its file may be edited while runs of it are kept."""
    named = (job.values.get(key) for job in jobs for key in ("source", "target"))
    names = sorted({str(name) for name in named if name is not None})
    return {name: load_case(name, world).fingerprint for name in names}


def write_plan(jobs: list[Job], config: StudyConfig) -> None:
    """Make the study's folder and write down what is planned; more seeds or arms may be added later.

    Raises:
        ConfigError: the folder cannot be written, or holds a study of other settings.
    """
    shared = run_config(config)
    most = max((job.values["layers"] for job in jobs if type(job.values.get("layers")) is int), default=0)
    if most > len(shared.network.conv):
        wanted = f"overrides: network has {len(shared.network.conv)} conv layers, and arms have up to {most}"
        raise ConfigError(f"{wanted}; allowed: arms=[...] of fewer layers")
    learn = plain(shared.learn)
    # It decides nothing that is learned, as the device does not, and may be another one later.
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
    cases = fingerprints(jobs, shared.world)
    path = config.folder / PLAN
    try:
        plan = read_json(path)
        before, known, begun = plan["settings"], plan.get("cases", {}), plan
        if not isinstance(before, dict) or not isinstance(known, dict):
            raise TypeError
    except FileNotFoundError:
        before, known, begun = None, {}, {}
    except (OSError, ValueError, KeyError, TypeError, RecursionError):
        raise ConfigError(f"output: {path} is not a study's plan; allowed: another output=FOLDER") from None
    changed = [f"case {name}" for name in cases if known.get(name, cases[name]) != cases[name]]
    if before is not None and (before != settings or changed):
        keys = sorted(settings.keys() | before.keys())
        differ = ", ".join([key for key in keys if settings.get(key) != before.get(key)] + changed)
        holds = f"output: {config.folder} holds a study of other settings ({differ})"
        raise ConfigError(f"{holds}; allowed: another output=FOLDER")
    try:
        config.folder.mkdir(parents=True, exist_ok=True)
        if not os.access(config.folder, os.W_OK | os.X_OK):
            raise PermissionError(13, "Permission denied")
        with replacing(path) as draft:
            listed = [dataclasses.asdict(job) for job in jobs]
            plan = {
                "settings": settings,
                "cases": known | cases,
                # What is judged, and by which rules, is what the study was begun with.
                "judged": begun.get("judged", list(config.numbers)),
                "rules": begun.get("rules", stamp()),
                "jobs": listed,
            }
            draft.write_text(json.dumps(plan, indent=1))
    except OSError as error:
        raise ConfigError(f"output: {config.folder} cannot be written: {error.strerror}") from None


def read_plan(path: Path, key: str) -> dict[str, Any]:
    """Read a `study.json`.

    Raises:
        ConfigError: there is none, or it is another program's; `key` names what it is of.
    """
    try:
        plan = read_json(path)
        jobs = [[job[name] for name in JOB] for job in plan["jobs"]]
        if not isinstance(plan["settings"], dict) or not isinstance(plan["cases"], dict):
            raise TypeError
        if not all(list(map(type, job)) == [str, int, str, str, str, int] for job in jobs):
            raise TypeError
    except FileNotFoundError:
        raise ConfigError(f"{key}: no {path}, the plan that a study has") from None
    except (OSError, ValueError, KeyError, TypeError):
        raise ConfigError(f"{key}: {path} is not a study's plan") from None
    return dict(plan)


def begun_with(folder: Path) -> tuple[tuple[int, ...], dict[str, Any]]:
    """Return the seeds and the rules that a study was begun with; nothing where there is no plan.

    Raises:
        ConfigError: there is one, and it is damaged: after how many seeds claims are judged is unknown then.
    """
    path = folder / PLAN
    try:
        plan = read_json(path)
        seeds = plan.get("judged", [job["seed"] for job in plan["jobs"] if job["part"] == PAIRS])
        rules = plan.get("rules", {})
        known = {key: rules[key] for key in ("digest", "commit", "begun")} if rules else {}
        if type(seeds) is not list or any(type(seed) is not int for seed in seeds):
            raise TypeError
        if not seeds and "judged" in plan:
            raise ValueError
        return tuple(sorted(set(seeds))), known
    except FileNotFoundError:
        return (), {}
    except (OSError, ValueError, KeyError, TypeError, AttributeError, RecursionError):
        wanted = "allowed: the file that the study was begun with, or none, to judge all its seeds at once"
        raise ConfigError(f"folder: {path} is not a study's plan; {wanted}") from None


def cases_of(folder: Path) -> dict[str, str]:
    """Return the fingerprints of a study's cases, by name; nothing where there is no plan to read."""
    try:
        return {str(name): str(given) for name, given in read_plan(folder / PLAN, "folder")["cases"].items()}
    except ConfigError:
        return {}


def warmup_of(folder: Path) -> int:
    """Return after how many episodes a study's runs learn at the earliest; 0 where no plan says it."""
    try:
        settings = read_plan(folder / PLAN, "folder")["settings"]
        return max(0, int(settings["learn"]["warmup_steps"] // settings["world"]["max_steps"]))
    except (ConfigError, KeyError, TypeError, ValueError, ArithmeticError):
        return 0
