"""Which runs a study consists of, and in what order: checked before anything is imported or written."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from omegaconf import MISSING, OmegaConf
from omegaconf.errors import OmegaConfBaseException

from ship_trl.config import ConfigError, explain
from ship_trl.paths import conf_dir

# Parts of a study, which are its folders: the paper's figures 5 to 7, figure 9, and our controls.
PAIRS, REUSE, CONTROLS, SOURCES = "pairs", "reuse", "controls", "sources"
# Section 4.3: the case that is most like the new one, and by which arm its network was made.
REUSED_CASE, REUSED_PAIR, REUSED_ARM, NEW_CASE = "2", "high", "FTW", "new"
OTHER_SOURCES = ("1", "3", "5")
LOW_EPSILON = 0.1
# Hydra's launchers (conf/hydra/launcher) and the plugins that bring them.
LAUNCHERS = {
    "joblib": "hydra_joblib_launcher",
    "slurm": "hydra_submitit_launcher",
    "slurm_local": "hydra_submitit_launcher",
    "ray_local": "hydra_ray_launcher",
    "ray_cluster": "hydra_ray_launcher",
}
RANDOM_ARM = "FE3-random"
SELF_PAIR, SELF_CASE = "self", "2"
SELF_ARMS = ("FE1", "FE2", "FE3", "FE4", "FT1", "FT2", "FT3", "FT4")


@dataclass
class StudyConfig:
    """What is asked for; values are in conf/study.yaml."""

    profile: str = MISSING
    seeds: int | None = None
    profile_seeds: dict[str, int] = MISSING
    pairs: list[str] = MISSING
    arms: list[str] = MISSING
    reuse: bool = MISSING
    controls: bool = MISSING
    output: str | None = None
    launcher: str = MISSING
    retries: int = MISSING
    overrides: list[str] = field(default_factory=list)

    @property
    def count(self) -> int:
        """How many seeds."""
        return self.profile_seeds[self.profile] if self.seeds is None else self.seeds

    @property
    def folder(self) -> Path:
        """Where everything lies."""
        return Path(self.output or f"outputs/{self.profile}_study")

    @property
    def of_runs(self) -> list[str]:
        """Overrides that are of the runs; the others are of Hydra and its launcher."""
        return [line for line in self.overrides if not line.startswith("hydra.")]


@dataclass(frozen=True)
class Job:
    """One run of a study.

    `stage` orders what depends on one another: all of a stage may run at once. `values` are set in
    the run's configuration, `groups` are chosen in it.
    """

    name: str
    stage: int
    part: str
    label: str
    arm: str
    seed: int
    values: dict[str, Any]

    def folder(self, study: Path) -> Path:
        """Where its results lie."""
        return study / self.part / self.label / self.arm / f"seed={self.seed}"


def to_study(overrides: list[str]) -> StudyConfig:
    """Compose conf/study.yaml with overrides and check it.

    Raises:
        ConfigError: an unknown key, a wrong value, an unknown name.
    """
    try:
        values = OmegaConf.merge(
            OmegaConf.structured(StudyConfig),
            OmegaConf.load(conf_dir() / "study.yaml"),
            OmegaConf.from_dotlist(overrides),
        )
        config: Any = OmegaConf.to_object(values)
    except OmegaConfBaseException as error:
        raise ConfigError(explain(error)) from None
    check(config)
    return config


def names(group: str) -> list[str]:
    """What a config group offers."""
    return sorted(path.stem for path in (conf_dir() / group).glob("*.yaml"))


def check(config: StudyConfig) -> None:
    """Check names and counts."""
    one_of("profile", [config.profile], names("profile"))
    one_of("pairs", config.pairs, names("pair"))
    one_of("arms", config.arms, names("arm"))
    one_of("launcher", [config.launcher], list(LAUNCHERS))
    plugin = LAUNCHERS[config.launcher]
    if find_spec(f"hydra_plugins.{plugin}") is None:
        extra = config.launcher.split("_")[0]
        raise ConfigError(f"launcher: {config.launcher} is not installed; ship_trl[{extra}] brings it")
    if config.count < 2:
        raise ConfigError(f"seeds: must be at least 2, got {config.count}")
    if config.retries < 0:
        raise ConfigError(f"retries: must be at least 0, got {config.retries}")
    if config.reuse and (REUSED_PAIR not in config.pairs or REUSED_ARM not in config.arms):
        raise ConfigError(
            f"reuse: needs pair {REUSED_PAIR} with arm {REUSED_ARM}, whose network it reuses; "
            "allowed: reuse=false"
        )


def one_of(key: str, got: list[str], allowed: list[str]) -> None:
    """Check that all names are allowed, and none is there twice."""
    for name in got:
        if name not in allowed:
            raise ConfigError(f"{key}: no {name}; allowed: {', '.join(allowed)}")
    if not got or len(set(got)) < len(got):
        raise ConfigError(f"{key}: each at most once and at least one, got {', '.join(got) or 'none'}")


def plan_jobs(config: StudyConfig) -> list[Job]:
    """All runs of a study, in the order of their stages."""
    jobs = [job for seed in range(config.count) for job in of_seed(config, seed)]
    return sorted(jobs, key=lambda job: (job.stage, job.seed))


def of_seed(config: StudyConfig, seed: int) -> Iterator[Job]:
    """The runs of one seed."""
    sources = {str(read("pair", pair)["source"]) for pair in config.pairs}
    if config.reuse:
        sources |= set(OTHER_SOURCES)
    from_scratch = {str(read("pair", pair)["target"]) for pair in config.pairs if "scratch" in config.arms}
    if config.controls:
        # The run from scratch that a pair has anyway serves as source; nothing is trained twice.
        sources |= {SELF_CASE} - from_scratch
    for case in sorted(sources):
        yield alone(SOURCES, case, seed, stage=0)
    for pair in config.pairs:
        for arm in config.arms:
            yield transfer(PAIRS, pair, arm, seed, stage=1)
        if config.controls:
            yield transfer(CONTROLS, pair, RANDOM_ARM, seed, stage=1)
    if config.controls:
        for arm in SELF_ARMS:
            yield transfer(CONTROLS, SELF_PAIR, arm, seed, stage=2)
    if config.reuse:
        yield from reuse_jobs(config, seed)


def reuse_jobs(config: StudyConfig, seed: int) -> Iterator[Job]:
    """Network (reused, from scratch) by starting epsilon (low, 1), and other sources at the low one."""
    low = {"learn": {"epsilon_start": LOW_EPSILON}}

    def policy(*place: str) -> str:
        return str(config.folder.absolute().joinpath(*place, f"seed={seed}", "policy.safetensors"))

    for part, extra in ((f"{REUSE}/epsilon_1", {}), (f"{REUSE}/epsilon_low", low)):
        yield alone(part, NEW_CASE, seed, 1, **extra)
        yield whole(part, REUSED_CASE, seed, 2, source_file=policy(PAIRS, REUSED_PAIR, REUSED_ARM), **extra)
        if extra:
            for case in OTHER_SOURCES:
                # By file, because a source of its own would be trained with the low epsilon too.
                yield whole(part, case, seed, 1, source_file=policy(SOURCES, case, "scratch"), **extra)


def read(group: str, name: str) -> dict[str, Any]:
    """The values of a config group's choice."""
    values: Any = OmegaConf.to_container(OmegaConf.load(conf_dir() / group / f"{name}.yaml"))
    return dict(values)


def job(stage: int, part: str, label: str, arm: str, seed: int, values: dict[str, Any]) -> Job:
    """A run; its name is also that of the file from which it can be started alone."""
    name = "-".join((part.replace("/", "-"), label, arm, str(seed)))
    return Job(name, stage, part, label, arm, seed, values | {"seed": seed})


def alone(part: str, case: str, seed: int, stage: int, **extra: Any) -> Job:
    """A case from scratch."""
    return job(stage, part, case, "scratch", seed, {"target": case, **read("arm", "scratch"), **extra})


def transfer(part: str, pair: str, arm: str, seed: int, stage: int) -> Job:
    """An arm on a pair."""
    return job(stage, part, pair, arm, seed, {**read("pair", pair), **read("arm", arm)})


def whole(part: str, source: str, seed: int, stage: int, **extra: Any) -> Job:
    """The whole network of another case on the new one."""
    cases = {"source": source, "target": NEW_CASE}
    return job(stage, part, f"{source}-{NEW_CASE}", "FTW", seed, {**cases, **read("arm", "FTW"), **extra})
