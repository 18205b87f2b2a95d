"""The runs of a study: settings (conf/study.yaml with overrides), arms, and jobs in their order."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from typing import Annotated, Any

import yaml
from omegaconf import OmegaConf
from omegaconf.errors import OmegaConfBaseException
from pydantic import Field

from ship_trl.config import arm as arms
from ship_trl.config.arm import ALL_LAYERS, Arm, SourceWeights, arm_names
from ship_trl.config.bounds import Positive, Seed
from ship_trl.config.checks import check_logger
from ship_trl.config.errors import ConfigError, missing_extra
from ship_trl.config.paths import conf_dir, conf_files, is_name, stem
from ship_trl.config.schema import read_as, rule
from ship_trl.config.types import Logger, WandbMode
from ship_trl.files.untrusted import read_changes, read_yaml
from ship_trl.grid.launchers import check_slurm
from ship_trl.sim.cases import read_values

SCRATCH, WHOLE = arms.SCRATCH.name, Arm("finetune", ALL_LAYERS).name
FE = tuple(Arm("feature_extraction", n).name for n in range(1, 5))
FT = tuple(Arm("finetune", n).name for n in range(1, 5))
TRANSFERS = (*FE, *FT, WHOLE)
# Controls whose frozen layers hold random weights, or the source's weights permuted within each layer.
RANDOM, PERMUTED = SourceWeights.random.value, SourceWeights.permuted.value
CONTROL_KINDS = (RANDOM, PERMUTED)


def control_arm(arm: str, kind: str) -> str:
    """Return the name of an arm's control."""
    return replace(Arm.parse(arm), weights=SourceWeights(kind)).name


def rivals(names: Iterable[str]) -> list[str]:
    """Return the arms among some names that are neither the paper's nor controls, in their order."""
    found = []
    for name in set(names) - {SCRATCH, *TRANSFERS}:
        with suppress(ValueError):  # networks on the new case have names of their own
            found.append(Arm.parse(name))
    return [arm.name for arm in sorted(found) if arm.weights is SourceWeights.learned]


# Controls of every seed: arms that run on each pair, and pairs with their arms. Pair "self" transfers case 2
# to itself; pair "ship" has a source with the target's ship but another path (section 4.1).
CONTROL_ARMS = tuple(control_arm("FE3", kind) for kind in CONTROL_KINDS)
CONTROL_PAIRS = {"self": (*FE, *FT), "ship": ("FE3", WHOLE)}
# Exploratory controls, only of the first block of seeds.
FIRST_BLOCK_ARMS = tuple(control_arm(f"FE{n}", kind) for kind in CONTROL_KINDS for n in (1, 2, 4))
FIRST_BLOCK_PAIRS = {"self": (WHOLE,), "self4": TRANSFERS, "self6": TRANSFERS}
# A control pair is compared with the runs from scratch of the pair that has the same target.
SCRATCH_PAIR = {"self": "high", "ship": "high", "self4": "low", "self6": "lowest"}
# The controls that each key could name.
CONTROLS_OF = {
    "pairs": {*CONTROL_PAIRS, *FIRST_BLOCK_PAIRS},
    "arms": {*CONTROL_ARMS, *FIRST_BLOCK_ARMS},
}

# Section 4.3: the case most similar to the new one, and the pair and arm that made the reused network.
REUSED_CASE, REUSED_PAIR, REUSED_ARM, NEW_CASE = "2", "high", WHOLE, "new"
# Hydra's launchers (conf/hydra/launcher), and the plugins of those that are called otherwise.
LAUNCHERS, PLUGINS = ("joblib", "slurm", "slurm_local", "ray_local", "ray_cluster"), {"slurm": "submitit"}
# One seed shows no variation over seeds.
SeedCount = Annotated[int, Field(ge=2)]
# Keys that each job sets itself.
JOB_KEYS = (
    *("pair", "source", "target", "source_file", "source_weights", "method", "layers", "arm", "seed"),
    *("profile", "output", "case_base", "logger", "overwrite", "extend", "demonstrations", "sweep"),
)


# The parts of a study, which are its folders: figures 5 to 7, figure 9, our controls, and further sources.
PAIRS, REUSE, CONTROLS, SOURCES = "pairs", "reuse", "controls", "sources"
LOW, ONE = f"{REUSE}/epsilon_low", f"{REUSE}/epsilon_1"
# Case 2's network trained on case 2 alone, as the other sources are; reused with the low epsilon.
ALONE = f"{REUSE}/alone"
PARTS = (SOURCES, PAIRS, CONTROLS, LOW, ONE, ALONE)
# Cases whose networks are reused on the new case too: the paper's sources, then targets of its pairs.
OTHER_SOURCES = ("1", "3", "5", "4", "6")
LOW_EPSILON = 0.1
# An arm's place in a study: part, pair (or another label), arm.
Place = tuple[str, str, str]
Places = Mapping[str, Place]


def reuse_label(source: str) -> str:
    """Return the label of a case's network on the new case."""
    return f"{source}-{NEW_CASE}"


# The networks on the new case, with the starting epsilon, which is low where none is named. Each "case N" was
# trained on its case alone, the reused network on two cases.
SOURCE_CASES = tuple(sorted((REUSED_CASE, *OTHER_SOURCES)))
REUSED: Places = {
    "reused, low": (LOW, reuse_label(REUSED_CASE), REUSED_ARM),
    "reused, 1": (ONE, reuse_label(REUSED_CASE), REUSED_ARM),
    "scratch, low": (LOW, NEW_CASE, SCRATCH),
    "scratch, 1": (ONE, NEW_CASE, SCRATCH),
    **{
        f"case {case}": (ALONE if case == REUSED_CASE else LOW, reuse_label(case), REUSED_ARM)
        for case in SOURCE_CASES
    },
}


# Keys that decide which runs a study has, and what it asks.
PLANNED = (
    *("question", "profile", "seeds", "first_seed", "block"),
    *("pairs", "arms", "reuse", "controls", "overrides"),
)


@dataclass
class StudyWandb:
    """The wandb project of a study."""

    project: str
    mode: WandbMode
    entity: str | None


@dataclass
class StudyConfig:
    """The settings; conf/study.yaml holds and explains the values."""

    question: Annotated[str, rule("one line of plain text", str.isprintable)]
    profile: str
    seeds: SeedCount | None
    first_seed: Seed
    block: Positive
    profile_seeds: dict[str, SeedCount]
    pairs: list[str]
    arms: list[str]
    reuse: bool | None
    controls: bool | None
    output: str | None
    launcher: str
    processes: Positive | None
    retries: Annotated[int, Field(ge=0)]
    overrides: list[str]
    logger: Logger
    wandb: StudyWandb

    @property
    def numbers(self) -> range:
        """The seeds."""
        count = self.profile_seeds[self.profile] if self.seeds is None else self.seeds
        return range(self.first_seed, self.first_seed + count)

    @property
    def folder(self) -> Path:
        """The study's folder."""
        return Path(self.output or f"outputs/{self.profile}_study")

    @property
    def words(self) -> list[str]:
        """The words after `study run` that plan the same runs, in any folder."""
        values = {key: getattr(self, key) for key in PLANNED} | {"seeds": len(self.numbers)}
        # JSON's lists, words and truth values are YAML too.
        texts = {key: json.dumps(value, ensure_ascii=False) for key, value in values.items() if value != ""}
        texts["profile"] = self.profile
        return [f"{key}={text}" for key, text in texts.items() if text != "[]"]


def to_study(words: list[str]) -> StudyConfig:
    """Compose conf/study.yaml, a study's file if the first word names one, and overrides; check the result.

    Raises:
        ConfigError: a key or a name is unknown, or a value is not allowed.
    """
    files = [Path(word) for word in words[:1] if "=" not in word]
    parts: list[Any] = []
    try:
        for path in files:
            parts += {"output": f"outputs/{stem(path)}"}, read_values(path)
        changes = read_changes(words[len(files) :])
        values = OmegaConf.merge(read_yaml(conf_dir() / "study.yaml"), *parts, changes)
    except (yaml.YAMLError, OmegaConfBaseException, LookupError, ValueError, TypeError, RecursionError):
        # OmegaConf raises Python's own errors for an unclosed bracket in a key, or thousands of digits.
        given, example = " ".join(words), "pairs=[high,low]"
        raise ConfigError(
            f"{given:.200}: cannot be read; a list is written without spaces, as {example}"
        ) from None
    config = read_as(StudyConfig, values)
    # A study of some arms is one's own.
    is_papers = {*TRANSFERS} <= {*config.arms}
    if config.reuse is None:
        config.reuse = is_papers and REUSED_PAIR in config.pairs
    if config.controls is None:
        has_controls = CONTROLS_OF["arms"] & {*config.arms}
        config.controls = is_papers and {*config.pairs} <= {*SCRATCH_PAIR.values()} and not has_controls
    check(config)
    return config


def check(config: StudyConfig) -> None:
    """Check names, the launcher, and keys that depend on one another."""
    check_names("profile", [config.profile], sorted(conf_files("profile")))
    check_names("pairs", config.pairs, sorted(conf_files("pair")))
    for name in config.arms:
        try:
            Arm.parse(name)
        except ValueError:
            raise ConfigError(f"arms: no {name}; allowed: {arm_names()}") from None
    check_names("arms", config.arms, config.arms)
    check_names("launcher", [config.launcher], list(LAUNCHERS))
    check_logger(config.logger)
    extra = config.launcher.split("_")[0]
    if find_spec(f"hydra_plugins.hydra_{PLUGINS.get(extra, extra)}_launcher") is None:
        raise ConfigError(f"launcher: {missing_extra(config.launcher, extra)}")
    check_slurm(config.launcher, "launcher")
    if config.seeds is None and config.profile not in config.profile_seeds:
        raise ConfigError(f"seeds: must be given; conf/study.yaml has none for profile {config.profile}")
    if config.processes is not None and config.launcher != "joblib":
        raise ConfigError(f"processes: must be left out with launcher={config.launcher}, which has its own")
    if config.reuse and (REUSED_PAIR not in config.pairs or REUSED_ARM not in config.arms):
        raise ConfigError(
            f"reuse: needs pair {REUSED_PAIR} with arm {REUSED_ARM}, whose network it reuses; "
            "allowed: reuse=false"
        )
    for key, names in (("pairs", config.pairs), ("arms", config.arms)):
        if config.controls and (found := [name for name in names if name in CONTROLS_OF[key]]):
            raise ConfigError(f"{key}: {found[0]} is one of the controls; allowed: controls=false")
    for key in (line.split("=")[0].lstrip("+~") for line in config.overrides):
        check_override(key, config)


def check_override(key: str, config: StudyConfig) -> None:
    """Refuse a key that differs between runs: an override would give all runs the same value."""
    if key in JOB_KEYS:
        raise ConfigError(
            f"overrides: {key} differs between runs; allowed: what all runs share, as learn.lr=1e-3"
        )
    if key.startswith("perturbation"):
        told = "a study compares with best known returns; allowed: none"
        raise ConfigError(f"overrides: perturbation: {told}")
    if key == "learn.epsilon_start" and config.reuse:
        raise ConfigError(f"overrides: {key} differs between runs; allowed: reuse=false")


def check_names(key: str, got: list[str], allowed: list[str]) -> None:
    """Check that there are names, that all are allowed, and that no name is repeated."""
    for name in got:
        if name not in allowed:
            raise ConfigError(f"{key}: no {name}; allowed: {', '.join(allowed)}")
    if not got or len(set(got)) < len(got):
        raise ConfigError(f"{key}: must be at least one name, each once, got {', '.join(got) or 'none'}")


def read_pair(name: str) -> dict[str, Any]:
    """Read the values of a pair's file in conf/pair, the bundled one or one of the working directory.

    Raises:
        ConfigError: it is no such file, or its cases have no names.
    """
    return dict(_read_pair(name, conf_files("pair")[name].absolute()))


@cache
def _read_pair(name: str, path: Path) -> Any:
    values: Any = OmegaConf.to_container(read_values(path))
    cases = [values.get(key) for key in ("source", "target")] if isinstance(values, dict) else []
    if not cases or not all(isinstance(case, str | int) and is_name(str(case)) for case in cases):
        raise ConfigError(f"pairs: {path}: must name a source and a target, as conf/pair/high.yaml")
    return values | {"pair": name, "source": str(cases[0]), "target": str(cases[1])}


@dataclass(frozen=True)
class Job:
    """A run of a study.

    Jobs of one `stage` may run in parallel; a job's source comes from an earlier stage. `name` is also the
    name of the file that starts the run alone. `values` are set in the run's configuration; a study that was
    kept as tables has none.
    """

    name: str
    stage: int
    part: str
    label: str
    arm: str
    seed: int
    values: dict[str, Any] = field(default_factory=dict)

    def folder(self, study: Path) -> Path:
        """Return the run's folder."""
        return study / self.part / self.label / self.arm / f"seed={self.seed}"


def plan_jobs(config: StudyConfig) -> list[Job]:
    """Plan all runs of a study, in the order of their stages."""
    jobs = [job for seed in config.numbers for job in seed_jobs(config, seed)]
    return sorted(jobs, key=lambda job: (job.stage, job.seed))


def seed_jobs(config: StudyConfig, seed: int) -> Iterator[Job]:
    """Plan the runs of one seed: pairs, reuse, controls; each group after the sources that it needs."""
    block = (seed - config.first_seed) // config.block
    groups = (
        [make_job(PAIRS, pair, arm, seed, read_pair(pair)) for pair in config.pairs for arm in config.arms],
        list(reuse_jobs(config, seed)),
        list(control_jobs(config, seed, CONTROL_ARMS, CONTROL_PAIRS)),
        list(control_jobs(config, seed, FIRST_BLOCK_ARMS, FIRST_BLOCK_PAIRS)) if block == 0 else [],
    )
    stage = 2 * len(groups) * block
    known: set[str] = set()
    for group in groups:
        needed = {str(job.values["source"]) for job in group if Arm.parse(job.arm).has_trained_source}
        for case in sorted(needed - known):
            if source_place(config, case) == (SOURCES, case):
                yield replace(make_job(SOURCES, case, SCRATCH, seed, {"target": case}), stage=stage)
        for job in group:
            is_source = (job.part, job.arm) == (PAIRS, SCRATCH) and str(job.values["target"]) in needed
            yield replace(job, stage=stage if is_source else stage + 1)
        known |= needed
        stage += 2


def make_job(part: str, label: str, arm: str, seed: int, cases: Mapping[str, Any], **extra: Any) -> Job:
    """Make a job of stage 0 with source and target, and with further values of its configuration."""
    name = "-".join((part.replace("/", "-"), label, arm, str(seed)))
    values = {**cases, **Arm.parse(arm).settings, **extra, "seed": seed}
    return Job(name, 0, part, label, arm, seed, values)


def reuse_jobs(config: StudyConfig, seed: int) -> Iterator[Job]:
    """Plan the 2 x 2 of network (reused, scratch) and starting epsilon (low, 1), and the other sources."""
    if not config.reuse:
        return

    def reuse(part: str, case: str, *place: str, **extra: Any) -> Job:
        # A path, because a source that the run trained itself would have the low epsilon too.
        folder = config.folder.absolute().joinpath(*place, f"seed={seed}")
        cases = {"source": case, "target": NEW_CASE}
        source_file = str(folder / "policy.safetensors")
        return make_job(part, reuse_label(case), WHOLE, seed, cases, source_file=source_file, **extra)

    low = {"learn": {"epsilon_start": LOW_EPSILON}}
    for part, extra in ((ONE, {}), (LOW, low)):
        yield make_job(part, NEW_CASE, SCRATCH, seed, {"target": NEW_CASE}, **extra)
        yield reuse(part, REUSED_CASE, PAIRS, REUSED_PAIR, REUSED_ARM, **extra)
    yield reuse(ALONE, REUSED_CASE, *source_place(config, REUSED_CASE), SCRATCH, **low)
    for case in OTHER_SOURCES:
        yield reuse(LOW, case, *source_place(config, case), SCRATCH, **low)


def control_jobs(
    config: StudyConfig, seed: int, arms: Sequence[str], pairs: Mapping[str, Sequence[str]]
) -> Iterator[Job]:
    """Plan control arms on all pairs, and control pairs whose target has runs from scratch in the study."""
    if not config.controls:
        return
    targets = {read_pair(pair)["target"] for pair in config.pairs}
    known = {pair: own for pair, own in pairs.items() if read_pair(pair)["target"] in targets}
    for pair, own in (*((pair, arms) for pair in config.pairs), *known.items()):
        for arm in own:
            yield make_job(CONTROLS, pair, arm, seed, read_pair(pair))


def source_place(config: StudyConfig, case: str) -> tuple[str, str]:
    """Return part and label of a case's run from scratch: those of a pair, if one has this target."""
    for pair in config.pairs if SCRATCH in config.arms else ():
        if str(read_pair(pair)["target"]) == case:
            return PAIRS, pair
    return SOURCES, case


def source_folder(job: Job, config: StudyConfig) -> Path | None:
    """Return the folder of the run that trains a job's source, relative to the study's; None without one."""
    if not Arm.parse(job.arm).has_trained_source:
        return None
    if "source_file" in job.values:
        return Path(job.values["source_file"]).parent.relative_to(config.folder.absolute())
    return Path(*source_place(config, str(job.values["source"])), SCRATCH, f"seed={job.seed}")


def scratch_place(part: str, label: str) -> Place:
    """Return the place of the runs from scratch that a label's runs are compared with."""
    if part in (LOW, ONE, ALONE):
        return (ONE if part == ONE else LOW), NEW_CASE, SCRATCH
    if part == CONTROLS:
        return PAIRS, SCRATCH_PAIR.get(label, label), SCRATCH
    return (SOURCES if part == SOURCES else PAIRS), label, SCRATCH
