"""The networks to compare: the named ones, the origin of the first, and untrained ones as a control."""

from __future__ import annotations

import copy
import dataclasses
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path

from torch import Generator
from yaml import YAMLError

from ship_trl.config.errors import ConfigError, one_line, print_error
from ship_trl.config.schema import read_as
from ship_trl.config.types import Config
from ship_trl.fast.worlds import make_env
from ship_trl.files.curve import RunError
from ship_trl.files.record import RESULT, RunRecord, read_run
from ship_trl.files.untrusted import read_yaml
from ship_trl.foreign.suites import load_suite
from ship_trl.learn.network import DuelingNetwork, make_network
from ship_trl.learn.rollout import greedy_policy, rollout
from ship_trl.policies.named import load_with_network
from ship_trl.policies.pretrained import find, is_pretrained
from ship_trl.policies.registry import SHOWN, Entry
from ship_trl.run.plan import Run
from ship_trl.run.results import locate, read_run_settings
from ship_trl.run.setup import read_source
from ship_trl.transfer.casebase import CONFIG
from ship_trl.transfer.methods import make_method

UNTRAINED_NETWORKS = 3


class Role(StrEnum):
    """Why a network is measured; `before` is the explained network before its training."""

    explained = "explained"
    before = "before training"
    source = "source"
    beside = "beside"
    untrained = "untrained"


@dataclass(frozen=True)
class Compared:
    """A network to measure. Networks with the same `settings` differ only in their seed; None if unknown."""

    name: str
    role: Role
    network: DuelingNetwork
    settings: tuple[object, ...] | None = None


@dataclass(frozen=True)
class Origin:
    """What the result folder of a network says about its training; None where that is unknown.

    `source` is the network that layers were `copied` from, `before` the network before training.
    """

    result: RunRecord | None = None
    source: DuelingNetwork | None = None
    before: DuelingNetwork | None = None
    copied: tuple[str, ...] = ()


def load_networks(entries: list[Entry]) -> list[Compared]:
    """Load the networks of the command line; the first is the explained one.

    Raises:
        ConfigError: a policy has no network or is there twice, or two networks differ in layers, observations
            or actions.
    """
    paths, labels = [one.policy for one in entries], [one.label.removesuffix(", best") for one in entries]
    found: list[Compared] = []
    for entry, name in zip(entries, labels if len(set(labels)) == len(labels) else paths, strict=True):
        if paths.count(entry.policy) > 1:
            raise ConfigError(f"policy: {entry.policy} is given twice; allowed: each network once")
        env = make_env(entry.suite.case, entry.world, 1, colour=entry.colour)
        _, network = load_with_network(entry.policy, env)
        if network.config.linear:
            raise ConfigError(f"policy: {entry.policy} sees numbers; allowed: networks that see pixels")
        if network.reused is not None:
            raise ConfigError(
                f"policy: {entry.policy} adds the Q-values of its source (method=q_reuse); "
                "allowed: networks of other methods"
            )
        first = found[0].network if found else network
        if (network.config, network.colour) != (first.config, first.colour):
            raise ConfigError(
                f"policy: {entry.policy} has other layers than {entries[0].policy}; "
                "allowed: networks with the same layers, colours and vector_time"
            )
        result = result_of(entry)
        told = read_run_settings(result, {}) if result else {}
        settings = (result.pair, result.arm, result.target, *sorted(told.items())) if result else None
        found.append(Compared(name, Role.beside if found else Role.explained, network, settings))
    return found


def result_of(entry: Entry) -> RunRecord | None:
    """Read the result beside a file of weights, if there is one."""
    try:
        return read_run(Path(entry.policy).parent)
    except RunError:
        return None


def find_origin(entry: Entry, name: str) -> Origin:
    """Find the source of a network, and draw the network before training from the seed of its run.

    Both are left out without a result. The drawn network must reach the return in the result.
    """
    result, folder = result_of(entry), Path(entry.policy).parent
    if result is None:
        return Origin()
    left_out, path = f"{name}: the network before training is left out", folder / CONFIG
    try:
        config = read_as(Config, read_yaml(path), f"{path}: ")
        given = result.source_network
        pretrained = find(given, None) if given is not None and is_pretrained(given) else None
        if given is not None and given != "random" and pretrained is None:
            config = dataclasses.replace(config, source_file=locate(given, folder))
        target = f"{folder / RESULT}: target"
        case = locate(result.target, folder)
        suite = load_suite(case, entry.world, target, config.perturbation, config.situations)
        run = Run(config, suite, None, folder, result.config_hash, pretrained)
        # The same weights as make_parts draws.
        weights = Generator().manual_seed(run.stream("weights"))
        before = make_network(config.network, len(entry.world.actions), weights, colour=entry.colour)
        found, source = read_source(run), None
        if found is not None:
            source = copy.deepcopy(before)
            source.load_state_dict(dict(found.weights))
            make_method(run.arm).copy(before, found.weights)
        starts = Generator().manual_seed(0)
        env = make_env(suite, entry.world, 1, colour=entry.colour, generator=starts)
        reached = rollout(env, greedy_policy(before, env.observer(config.network)))[0].episode_return
    except (ConfigError, OSError, ValueError, YAMLError) as error:
        print_error(f"{left_out}: {one_line(str(error))}")
        return Origin(result)
    expected = result.before.episode_return
    if not abs(reached - expected) < SHOWN:
        print_error(f"{left_out}: it should return {expected:.1f} and returns {reached:.1f}")
        return Origin(result, source)
    shown = (*before.layer_names, "shared")
    copied = [name for name in run.arm.copied(before.all_layers, before.layer_names) if name in shown]
    return Origin(result, source, before, tuple(copied))


def make_untrained(like: DuelingNetwork, generator: Generator) -> DuelingNetwork:
    """Draw an untrained network with the layers of `like`."""
    network = copy.deepcopy(like)
    network.reset(generator)
    return network


def add_controls(named: list[Compared], origin: Origin, generator: Generator) -> list[Compared]:
    """Add the origin of the first network and untrained networks to the named ones."""
    first, *others = named
    owned = (
        (f"{first.name} before training", Role.before, origin.before),
        (f"source of {first.name}", Role.source, origin.source),
    )
    found = [Compared(name, role, network) for name, role, network in owned if network is not None]
    drawn = [make_untrained(first.network, generator) for _ in range(UNTRAINED_NETWORKS)]
    untrained = [Compared(f"untrained {k}", Role.untrained, one) for k, one in enumerate(drawn, 1)]
    return [first, *found, *others, *untrained]
