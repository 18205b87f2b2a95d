"""Which networks are looked at: those named, what they came from, and untrained ones as a control."""

from __future__ import annotations

import copy
import dataclasses
from dataclasses import dataclass
from pathlib import Path

from omegaconf import OmegaConf
from omegaconf.errors import OmegaConfBaseException
from torch import Generator
from yaml import YAMLError

from ship_trl.config.errors import ConfigError, explain, print_error
from ship_trl.config.network import load_network
from ship_trl.config.types import Config, plain
from ship_trl.files.result import RESULT, Result, ResultError, read_result
from ship_trl.files.untrusted import read_yaml
from ship_trl.learn.network import DuelingNetwork
from ship_trl.learn.policy import greedy_policy
from ship_trl.learn.rollout import rollout
from ship_trl.policies.entry import SHOWN, Entry
from ship_trl.policies.named import load_with_network
from ship_trl.policies.pretrained import find, is_pretrained
from ship_trl.run.run import Run
from ship_trl.run.source import read_source
from ship_trl.sim.cases import load_case
from ship_trl.sim.env import ShipEnv
from ship_trl.transfer.casebase import CONFIG
from ship_trl.transfer.layers import copy_layers

# Networks of drawn weights, beside which every probe is judged.
UNTRAINED = 3


@dataclass(frozen=True)
class Subject:
    """A network by the name that it has on the page, and what its result folder says of it.

    `source` is the network that its layers were copied from, `before` itself as training began; None where
    that is not known. `copied` names the layers that were copied, `frozen` says that they could not change.
    """

    name: str
    network: DuelingNetwork
    result: Result | None = None
    source: DuelingNetwork | None = None
    before: DuelingNetwork | None = None
    copied: tuple[str, ...] = ()
    frozen: bool = False

    @property
    def kin(self) -> tuple[str, ...] | None:
        """What networks that were trained alike, but for their seed, have in common."""
        if self.result is None:
            return None
        return self.result.pair, self.result.arm, self.result.target


def load_subjects(entries: list[Entry]) -> list[Subject]:
    """Load every network of the command line, and where it came from as far as that is known.

    Raises:
        ConfigError: a policy without a network, networks that do not see or act alike, or of other layers.
    """
    found: list[Subject] = []
    names = name_entries(entries)
    for entry, name in zip(entries, names, strict=True):
        env = ShipEnv(entry.case, entry.world, 1, colour=entry.colour)
        _, network = load_with_network(entry.policy, env)
        if found and plain(network.config) != plain(found[0].network.config):
            raise ConfigError(
                f"policy: {entry.policy} is of another network than {entries[0].policy}; "
                "allowed: networks of the same layers"
            )
        found.append(with_origin(entry, Subject(name, network, result_of(entry))))
    return found


def result_of(entry: Entry) -> Result | None:
    """Read the result beside a file of weights, if there is one."""
    try:
        return read_result(Path(entry.policy).parent)
    except ResultError:
        return None


def name_entries(entries: list[Entry]) -> list[str]:
    """Name networks as shortly as tells them apart: by arm and seed, then with the pair, then by path."""
    results = [result_of(entry) for entry in entries]
    forms = (
        lambda r, e: f"{r.arm} seed {r.seed}" if r else Path(e.policy).stem,
        lambda r, e: f"{r.pair} {r.arm} seed {r.seed}" if r else e.policy,
        lambda _, e: e.policy,
    )
    for form in forms:
        names = [form(result, entry) for result, entry in zip(results, entries, strict=True)]
        if len(set(names)) == len(names):
            return names
    raise ConfigError(f"policy: {next(n for n in names if names.count(n) > 1)} is given twice")


def with_origin(entry: Entry, subject: Subject) -> Subject:
    """Add the network as its training began, and its source, where its folder still leads to them."""
    result, folder = subject.result, Path(entry.policy).parent
    if result is None:
        return subject
    try:
        config = read_config(folder / CONFIG)
        given = result.source_network
        pretrained = find(given, None) if given is not None and is_pretrained(given) else None
        if given is not None and given != "random" and pretrained is None:
            config = dataclasses.replace(config, source_file=given)
        case = load_case(result.target, entry.world, f"{folder / RESULT}: target")
        run = Run(config, case, None, folder, result.config_hash, pretrained)
        channels, actions = (3 if entry.colour else 1), len(entry.world.actions)
        # As train_run begins.
        before = DuelingNetwork(
            channels, actions, Generator().manual_seed(run.stream("weights")), config.network
        )
        found, source = read_source(run), None
        if found is not None:
            source = copy.deepcopy(before)
            source.load_state_dict(dict(found.weights))
            copy_layers(before, found.weights, run.arm)
        env = ShipEnv(case, entry.world, 1, colour=entry.colour)
        reached = rollout(env, greedy_policy(before, env.rasteriser))[0].episode_return
    except ConfigError as error:
        print_error(f"{subject.name}: the network before training is left out: {error}")
        return subject
    if not abs(reached - result.before.episode_return) < SHOWN:
        print_error(
            f"{subject.name}: the network before training is left out: it should return "
            f"{result.before.episode_return:.1f} and returns {reached:.1f}"
        )
        return dataclasses.replace(subject, source=source)
    layers = before.conv_names
    copied = layers[: run.arm.copied_layers(len(layers))]
    if run.arm.copies_all:
        copied = (*copied, "shared")
    frozen = run.arm.frozen_layers > 0
    return dataclasses.replace(subject, source=source, before=before, copied=copied, frozen=frozen)


def read_config(path: Path) -> Config:
    """Read the configuration of a run.

    Raises:
        ConfigError: there is none, or it lacks something.
    """
    # Not in configurations of older programs, which knew one of each.
    older = {
        "network": plain(load_network()),
        "checkpoint": {"every": 1.0, "seconds": 0.0},
        "learn": {"backend": "auto"},
        "demonstrations": None,
        "objective": "late",
    }
    try:
        values = OmegaConf.merge(OmegaConf.structured(Config), older, read_yaml(path))
        config: Config = OmegaConf.to_object(values)  # type: ignore[assignment]
    except OmegaConfBaseException as error:
        raise ConfigError(f"{path}: {explain(error)}") from None
    except (OSError, ValueError, OverflowError, YAMLError) as error:
        raise ConfigError(f"{path} is not a configuration: {' '.join(str(error).split())}") from None
    return config


def untrained(like: DuelingNetwork, generator: Generator) -> list[DuelingNetwork]:
    """Draw networks of the same layers as `like`, as they are drawn before training."""
    found = []
    for _ in range(UNTRAINED):
        drawn = copy.deepcopy(like)
        drawn.reset(generator)
        found.append(drawn)
    return found
