"""Plan a run before torch is imported: load its suites, hash its settings, check its folder."""

from __future__ import annotations

import dataclasses
import hashlib
import json
import os
import re
import shlex
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from filelock import FileLock
from omegaconf import OmegaConf
from yaml import YAMLError

from ship_trl.config.arm import SCRATCH, Arm, SourceWeights
from ship_trl.config.bounds import RewardScale
from ship_trl.config.checks import named_learn, non_default_algorithm, reads_of
from ship_trl.config.errors import ConfigError, one_line, override, require
from ship_trl.config.imports import digest_function
from ship_trl.config.network import non_default_network
from ship_trl.config.paths import conf_files, stem
from ship_trl.config.schema import read_as
from ship_trl.config.types import (
    Config,
    Perturbation,
    Situations,
    Transfer,
    World,
    describe_margin,
    plain,
    world_values,
)
from ship_trl.files.curve import RunError
from ship_trl.files.disk import atomic_write, remove
from ship_trl.files.record import RESULT, RunRecord, read_run
from ship_trl.files.untrusted import read_yaml
from ship_trl.foreign.suites import load_suite
from ship_trl.learn.settings import TEACHERS
from ship_trl.policies.demonstrations import Demonstration, read_demonstrations
from ship_trl.policies.pretrained import PRETRAINED, REWARD_SCALE, Pretrained, find, is_pretrained, networks
from ship_trl.run.header import read_header
from ship_trl.sim.cases import Suite, describe, load_case, read_values
from ship_trl.transfer.casebase import CONFIG, LOCKS, POLICY, POLICY_LAST, rank

# Increase it with every change after which the same settings learn something else, so that results of an
# older version are not mistaken for results of this one.
ALGORITHM_VERSION = 3
# The same for the numbers that a network without pixels sees (`sim.vector`).
VECTOR_VERSION = 3
# Weights that were learned on the source.
LEARNED = (SourceWeights.learned, SourceWeights.pretrained)
# The setting that names a teacher.
TEACHER = "algorithm.teacher"
# Prefix of the name of a damaged result folder that a study has kept.
DAMAGED = "damaged-"
# Folder of checkpoints in a run's folder, until the run is finished. The last one stays there, to extend it.
CHECKPOINTS, LAST_CHECKPOINT = "checkpoint", "checkpoint.safetensors"
# Settings that do not change what a run learns.
IGNORED_KEYS = {
    *("output", "case_base", "overwrite", "logger", "wandb", "checkpoint", "objective", "pair", "profile"),
    *("extend", "fast"),
}
MAX_DIFFERENCES_SHOWN = 3


@dataclass(frozen=True)
class Run:
    """An arm on a target suite with a seed, as `make_run` plans it.

    `source` is the run that trains the source network; None if no source has to be trained. `config_hash` is
    a digest of everything that decides what is learned: the same hash gives the same network on the same
    machine and backend. `demonstrations` fill the replay before training. `source_suite` is what the source
    network learned, if it did and if it can be evaluated without drawing. `extended` are the episodes at
    which earlier runs ended, from which this one goes on; `extends` is the hash of the last of them.
    """

    config: Config
    target: Suite
    source: Run | None
    folder: Path
    config_hash: str
    pretrained: Pretrained | None = None
    demonstrations: tuple[Demonstration, ...] = ()
    source_suite: Suite | None = None
    extended: tuple[int, ...] = ()
    extends: str | None = None

    @property
    def arm(self) -> Arm:
        """Arm of the run."""
        return self.config.arm

    @property
    def title(self) -> str:
        """Title of the run for people, in one line."""
        config = self.config
        start = "" if self.arm.is_scratch else f"{describe(str(config.source))} -> "
        return f"{start}{describe(str(config.target))}, {config.arm_label}, seed {config.seed}"

    @property
    def evaluation_episodes(self) -> int:
        """Number of episodes of a greedy evaluation: each case once, or the episodes asked for if drawn."""
        asked = self.config.learn.evaluate_episodes if self.target.is_drawn else 1
        return self.target.whole_rounds(asked)

    @property
    def entry_arm(self) -> str:
        """Name of its network in the case base: the arm and, after a transfer, the source case."""
        label = self.config.arm_label
        return label if self.arm.is_scratch else f"{label}-from-{stem(str(self.config.source))}"

    def stream(self, purpose: str) -> int:
        """Return the seed of the random stream for one purpose.

        It depends on source and target. Otherwise the new layers of a transfer would get the initial weights
        of its source, which were trained together with the copied layers.
        """
        # The stem, so that a bundled case by name and by path gets the same streams.
        source = "" if self.arm.is_scratch else self.config.source and stem(self.config.source)
        words = (self.config.seed, source, self.target.fingerprint, purpose)
        return int.from_bytes(hashlib.sha256(json.dumps(words).encode()).digest()[:8], "big") >> 1

    def lock(self) -> FileLock:
        """Return the lock to hold while the run's folder is written; its file is never deleted."""
        config, locks = self.config, Path(self.config.output) / LOCKS
        locks.mkdir(parents=True, exist_ok=True)
        return FileLock(locks / f"{config.label}-{config.arm_label}-{config.seed}.lock")


def make_run(config: Config) -> Run:
    """Plan the run of a checked configuration, and first the run that trains its source.

    Raises:
        ConfigError: a case is missing or invalid, the folder cannot be written, or holds another run, or none
            to extend.
    """
    world = config.world
    target = load_suite(str(config.target), world, "target", config.perturbation, config.situations)
    config = resolve_pretrained(config, target)
    # Without a pair, its label is the names of the cases.
    folder = Path(config.output) / config.label / config.arm_label / f"seed={config.seed}"
    extended = find_ends(folder, config.learn.episodes) if config.extend else ()
    source, pretrained, source_suite = None, None, None
    if not config.arm.is_scratch:
        origin = load_suite(str(config.source), world, "source", reading=config.situations)
        if config.arm.weights in LEARNED and not origin.is_drawn:
            source_suite = origin
        if config.arm.weights is SourceWeights.pretrained:
            pretrained = find(PRETRAINED, origin, "source", config.observation.name)
        elif config.source_file is None and config.arm.has_trained_source:
            source = make_source(first_config(config, extended))
        elif config.source_file is not None and not Path(config.source_file).is_file():
            raise ConfigError(f"source_file: no file {config.source_file}; allowed: a safetensors file")
    demonstrations: tuple[Demonstration, ...] = ()
    if config.demonstrations is not None:
        if not target.is_fixed:
            raise ConfigError("demonstrations: allowed with one case as target, and with no perturbation")
        demonstrations = tuple(read_demonstrations(Path(config.demonstrations), target.case, world))
    if target.is_drawn and reads_of(config.algorithm).is_on_policy:
        imitation, allowed = config.algorithm["imitation_coeff"], "0 where each episode has another start"
        require(not imitation, "algorithm.imitation_coeff", f"{allowed}, as in {target.name}", imitation)
    given = target, source, pretrained, demonstrations
    run = Run(
        config,
        target,
        source,
        folder,
        hash_of(config, *given, extended=extended),
        pretrained,
        demonstrations,
        source_suite,
        extended,
        hash_of(config.with_episodes(extended[-1]), *given, extended=extended[:-1]) if extended else None,
    )
    check_folder(run)
    return run


def make_source(config: Config) -> Run:
    """Plan the run that trains a run's source.

    Raises:
        ConfigError: see `make_run`.
    """
    source_config = dataclasses.replace(
        config.with_arm(SCRATCH),
        pair=None,
        target=config.source,
        demonstrations=None,
        # Both are meant for the target's folder only.
        overwrite=False,
        extend=False,
    )
    try:
        return make_run(source_config)
    except TakenError as error:
        raise ConfigError(
            f"output: {error.folder}, where the source would be trained, holds {error.held}; "
            "allowed: another output=FOLDER, or "
            f"{shlex.quote(override('target', config.source))} method=scratch overwrite=true first"
        ) from None


def first_config(config: Config, extended: Sequence[int]) -> Config:
    """Return the configuration of the run with which an extended one began."""
    return config.with_episodes(extended[0]) if extended else config


def resolve_pretrained(config: Config, target: Suite) -> Config:
    """Replace `source=pretrained` by the pair's source or, without a pair, the most similar bundled case."""
    if config.source != PRETRAINED:
        return config
    if config.pair is not None:
        pair = conf_files("pair").get(config.pair)
        if pair is None:
            raise ConfigError(
                f"source: {PRETRAINED} needs a file conf/pair/{config.pair}.yaml; "
                "allowed: source=CASE source_weights=pretrained"
            )
        source = str(read_values(pair).source)
    else:
        names = [one.name for one in networks()]
        cases = [load_case(name, config.world, "source") for name in names]
        other_cases = [case for case in cases if case.fingerprint != target.case.fingerprint]
        source = rank(target.case, other_cases, config.world)[0].case.name
    # From scratch too the source is in the folder's name, so that it is that of the transfers of a grid.
    weights = config.source_weights if config.arm.is_scratch else SourceWeights.pretrained
    return dataclasses.replace(config, source=source, source_weights=weights)


def hash_of(
    config: Config,
    target: Suite,
    source: Run | None,
    pretrained: Pretrained | None = None,
    demonstrations: Sequence[Demonstration] = (),
    version: int | None = None,
    extended: Sequence[int] = (),
) -> str:
    """Return a digest of everything that decides what is learned: twelve hex digits.

    That of an extended run is made of the digest of its first run, and of where each run ended.
    """
    origin = source.config_hash if source else None
    if config.source_file is not None:
        origin = hashlib.sha256(Path(config.source_file).read_bytes()).hexdigest()
    if config.arm.weights is SourceWeights.random:
        origin = "random"
    elif pretrained is not None:
        # Includes the name of the case, because the random streams depend on it.
        origin = f"pretrained {stem(str(config.source))} {pretrained.sha256}"
    elif config.arm.weights is SourceWeights.permuted:
        origin = f"permuted {origin}"
    learn = named_learn(first_config(config, extended).learn)
    # They do not change what is learned.
    del learn["jumpstart_draws"]
    if not target.is_drawn:
        # Then it is not used.
        del learn["evaluate_episodes"]
    values: dict[str, Any] = {
        "algorithm_version": version or ALGORITHM_VERSION,
        "target": target.fingerprint,
        "source": origin,
        **config.arm.keys,
        "seed": config.seed,
        "colour": config.colour,
        "world": world_values(config.world),
        "learn": learn,
    }
    # In place of paths, what is in the files.
    digests = {"build": digest_function(config.algorithm["build"])}
    if (teacher := find_teacher(config)) is not None:
        factor = "" if teacher.factor == 1 else f" times {teacher.factor:g}"
        digests["teacher"] = f"{teacher.digest}{factor}"
    # Left out where they are the default, so that older results keep their digest.
    algorithm = non_default_algorithm(config.algorithm)
    own, default = (plain(each).get(config.method, {}) for each in (config.transfer, Transfer()))
    optional: dict[str, Any] = {
        "transfer": {key: value for key, value in own.items() if value != default[key]},
        "margin": describe_margin(config.margin),
        "mask": config.mask and digest_function(config.mask),
        "network": non_default_network(config.network),
        "vector_version": VECTOR_VERSION if config.network.linear else None,
        "algorithm": algorithm and algorithm | digests,
        "demonstrations": [one.actions for one in demonstrations],
    }
    values |= {key: value for key, value in optional.items() if value}
    first = digest_values(values)
    return digest_values([first, *extended[1:], config.learn.episodes]) if extended else first


def digest_values(values: Any) -> str:
    """Return twelve hex digits of the SHA-256 of values for JSON."""
    return hashlib.sha256(json.dumps(values, sort_keys=True).encode()).hexdigest()[:12]


@dataclass(frozen=True)
class TeacherFile:
    """The network of a teacher: name as given and SHA-256 of the file, its path, and the digest.

    `factor` is that from its scaled rewards to the run's; 1 where its own are unknown.
    """

    name: str
    path: Path
    digest: str
    factor: float


def find_teacher(config: Config) -> TeacherFile | None:
    """Return the teacher's network, or None for an algorithm without a teacher.

    Raises:
        ConfigError: there is no such file, or it is in a result folder of another world.
    """
    if (name := config.algorithm.get("teacher")) is None:
        return None
    path, scale = Path(str(name)), config.learn.reward_scale
    if is_pretrained(str(name)) and name != PRETRAINED:
        path, scale = find(str(name), None, TEACHER).file, REWARD_SCALE
    elif path.is_dir():
        path = path / POLICY
    if not path.is_file():
        raise ConfigError(f"{TEACHER}: no file {path}; allowed: {TEACHERS}")
    # A file of another name may lie beside any other config.yaml.
    known = path.parent / CONFIG
    if path.name in (POLICY, POLICY_LAST) and known.is_file():
        if others := differences(read_settings(path.parent)[0], config.world, "world"):
            told = f"{path.parent} is of another world: {others[0]}"
            raise ConfigError(f"{TEACHER}: {told}; allowed: the same world")
        key, where = "learn.reward_scale", f"{TEACHER}: {known}: "
        scale = read_as(RewardScale, OmegaConf.select(read_yaml(known), key), where, key=key)
    digest = hashlib.sha256(path.read_bytes()).hexdigest()
    return TeacherFile(f"{name} sha256={digest}", path, digest, config.learn.reward_scale / scale)


class TakenError(ConfigError):
    """The folder holds a run of other settings, or a damaged result.

    Both arguments are kept, so that a process of a grid can pickle the error for its launcher.
    """

    def __init__(self, folder: Path, held: str) -> None:
        super().__init__(folder, held)
        self.folder, self.held = folder, held

    def __str__(self) -> str:
        return one_line(
            f"output: {self.folder} holds {self.held}; "
            "allowed: another output=FOLDER, or overwrite=true to replace it"
        )


def find_ends(folder: Path, episodes: int) -> tuple[int, ...]:
    """Return where the runs in a folder ended that a run of `episodes` goes on from, the first one first.

    Raises:
        ConfigError: the folder holds no finished run, or one of as many episodes.
    """
    try:
        # While it is extended, a run has no result.
        held = read_run(folder) if (folder / RESULT).exists() else read_header(folder / LAST_CHECKPOINT)
    except RunError as error:
        raise ConfigError(f"extend: {folder} holds a damaged result: {error}; allowed: a whole one") from None
    if held is None:
        raise ConfigError(f"extend: {folder} holds no finished run; allowed: extend=false, which trains one")
    if held.extended and episodes == held.episodes:
        return tuple(held.extended)
    allowed = f"more than {held.episodes} with extend=true, which {folder} has"
    require(episodes > held.episodes, "learn.episodes", allowed, episodes)
    return (*held.extended, held.episodes)


def check_folder(run: Run) -> None:
    """Check, before a run begins, that its folder is writable and that no other run would be overwritten."""
    parent = next(folder for folder in (run.folder, *run.folder.parents) if folder.exists())
    if not parent.is_dir() or not os.access(parent, os.W_OK | os.X_OK):
        raise ConfigError(f"output: {parent} is not a folder that can be written")
    find_result(run)


def find_result(run: Run) -> RunRecord | None:
    """Return the run's result if its folder holds it, or None if the run may be trained there.

    With `overwrite=true`, it may also be trained in a folder of another run or of a damaged result.

    Raises:
        TakenError: the folder holds a run of other settings, finished or not, or a damaged result.
        ConfigError: it holds another run than the one to extend, or not the checkpoint of its end.
    """
    held, folder = "", run.folder
    if (folder / RESULT).exists():
        try:
            result = read_run(folder)
            if result.config_hash == run.config_hash:
                return result
            held = describe_finished(run, result)
        except RunError as error:
            held = f"a damaged result: {error}"
    else:
        paths = [*(folder / CHECKPOINTS).glob("*.safetensors")] or [folder / LAST_CHECKPOINT]
        headers = [read_header(path) for path in paths if path.exists()]
        is_known = any(one and one.config_hash in (run.config_hash, run.extends) for one in headers)
        # Without a readable checkpoint, the folder may hold this run or another.
        if headers and not is_known and ((told := list_differences(folder, run.config)) or any(headers)):
            held = f"an unfinished run of other settings{told}"
    if held and run.extends:
        allowed = "a run trained with checkpoint.keep=true and the same settings but for learn.episodes"
        raise ConfigError(f"extend: {folder} holds {held}; allowed: {allowed}")
    if held and not run.config.overwrite:
        raise TakenError(folder, held)
    return None


def describe_finished(run: Run, result: RunRecord) -> str:
    """Describe a finished run of another hash in a run's folder; empty if the run can go on from it."""
    folder, config = run.folder, run.config
    if result.config_hash == run.extends:
        last = read_header(folder / LAST_CHECKPOINT)
        return "" if last and last.config_hash == run.extends else f"no {LAST_CHECKPOINT} of its end"
    # A run to extend may have fewer episodes.
    told = list_differences(folder, config.with_episodes(result.episodes) if run.extends else config)
    extended = f", extended at episode {result.extended[-1]}" if result.extended else ""
    return f"a finished run of other settings{told}{extended}"


def list_differences(folder: Path, config: Config) -> str:
    """List the first settings that differ in a run's folder, such as ` (learn.lr=0.001)`; may be empty."""
    try:
        found = differences(OmegaConf.to_container(read_yaml(folder / CONFIG)), config)
    except (OSError, YAMLError):
        return ""
    return f" ({', '.join(found[:MAX_DIFFERENCES_SHOWN])})" if found else ""


def differences(values: Any, others: Any, prefix: str = "") -> list[str]:
    """List the values of a configuration that are not those of another one, as `key=value`."""
    known = dict(flatten(plain(others), prefix))
    found = flatten(values if isinstance(values, dict) else plain(values), prefix)
    return [f"{key}={value}" for key, value in found if key in known and known[key] != value]


def tracked_settings(run: Run) -> dict[str, Any]:
    """Return a run's configuration for trackers, behind the names by which they group runs.

    These are `task` (the pair, or the target), `arm` and `algo`.
    """
    config = run.config
    algorithm = re.split(r"[./]", config.algorithm["build"].rpartition(":")[0].removesuffix(".py"))[-1]
    names = {"task": config.label, "arm": config.arm_label, "algo": algorithm}
    return names | plain(config) | {"config_hash": run.config_hash}


def flatten(values: Any, prefix: str = "") -> Iterator[tuple[str, Any]]:
    """Yield the values of a nested configuration by their dotted keys; a list is one value."""
    if not isinstance(values, dict):
        yield prefix, values
        return
    for key, value in values.items():
        if prefix or key not in IGNORED_KEYS:
            yield from flatten(value, f"{prefix}.{key}" if prefix else str(key))


def open_folder(run: Run, resume: bool = False) -> None:
    """Empty the run's folder and write its configuration.

    It deletes an unfinished run, or a run that `overwrite=true` replaces. With `resume` it keeps the
    checkpoints, because everything else is written again; so it does for a run that is extended.
    """
    run.folder.mkdir(parents=True, exist_ok=True)
    for path in run.folder.iterdir():
        if path.name not in (CHECKPOINTS, LAST_CHECKPOINT) or not resume:
            remove(path)
    with atomic_write(run.folder / CONFIG) as draft:
        OmegaConf.save(OmegaConf.structured(run.config), draft)
    (run.folder / CHECKPOINTS).mkdir(exist_ok=True)


def read_settings(folder: Path) -> tuple[World, bool, Perturbation, Situations]:
    """Read a run's world, whether its pictures have colours, its perturbation and its situations."""
    path = folder / CONFIG
    try:
        values: Any = read_yaml(path)
        world = read_as(World, values.world, key="world")
        perturbation = read_as(Perturbation, values.get("perturbation") or {}, key="perturbation")
        reading = read_as(Situations, values.get("situations") or {}, key="situations")
        return world, bool(values.colour), perturbation, reading
    except ConfigError as error:
        raise ConfigError(f"policy: {path}: {error}") from None
    except (OSError, AttributeError, ValueError, YAMLError) as error:
        raise ConfigError(f"policy: {path} is not a configuration: {' '.join(str(error).split())}") from None
