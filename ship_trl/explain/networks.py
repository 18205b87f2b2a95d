"""The networks to compare: the named ones, the origin of the first, and untrained ones as a control."""

from __future__ import annotations

import copy
import dataclasses
from dataclasses import dataclass
from pathlib import Path

from omegaconf.errors import OmegaConfBaseException
from torch import Generator
from yaml import YAMLError

from ship_trl.config.errors import ConfigError, print_error
from ship_trl.config.schema import read_as
from ship_trl.config.types import Config, plain
from ship_trl.explain.rows import Compared, Role
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

UNTRAINED_NETWORKS = 3


@dataclass(frozen=True)
class Origin:
    """What the result folder of a network tells of its training; None where that is not known.

    `source` is the network that layers were `copied` from, `before` the network as training began.
    """

    result: Result | None = None
    source: DuelingNetwork | None = None
    before: DuelingNetwork | None = None
    copied: tuple[str, ...] = ()
    is_frozen: bool = False


def load_networks(entries: list[Entry]) -> list[Compared]:
    """Load every network of the command line; the first is the explained one.

    Raises:
        ConfigError: a policy without a network, or networks of different layers, observations or actions.
    """
    results = [result_of(entry) for entry in entries]
    found: list[Compared] = []
    for entry, result, name in zip(entries, results, name_entries(entries, results), strict=True):
        env = ShipEnv(entry.case, entry.world, 1, colour=entry.colour)
        _, network = load_with_network(entry.policy, env)
        if found and plain(network.config) != plain(found[0].network.config):
            raise ConfigError(
                f"policy: {entry.policy} has other layers than {entries[0].policy}; "
                "allowed: networks of the same layers"
            )
        settings = (result.pair, result.arm, result.target) if result else None
        found.append(Compared(name, Role.beside if found else Role.explained, network, settings))
    return found


def result_of(entry: Entry) -> Result | None:
    """Read the result beside a file of weights, if there is one."""
    try:
        return read_result(Path(entry.policy).parent)
    except ResultError:
        return None


def name_entries(entries: list[Entry], results: list[Result | None]) -> list[str]:
    """Give networks short names that differ: arm and seed, else with the pair, else the path."""
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


def find_origin(entry: Entry, name: str) -> Origin:
    """Find the source of a network, and draw the network as training began from the seed of its run.

    Without a result, or if that network does not return what the result says, they are left out.
    """
    result, folder = result_of(entry), Path(entry.policy).parent
    if result is None:
        return Origin()
    try:
        config = read_config(folder / CONFIG)
        given = result.source_network
        pretrained = find(given, None) if given is not None and is_pretrained(given) else None
        if given is not None and given != "random" and pretrained is None:
            config = dataclasses.replace(config, source_file=given)
        case = load_case(result.target, entry.world, f"{folder / RESULT}: target")
        run = Run(config, case, None, folder, result.config_hash, pretrained)
        channels, actions = (3 if entry.colour else 1), len(entry.world.actions)
        # As make_parts does.
        weights = Generator().manual_seed(run.stream("weights"))
        before = DuelingNetwork(channels, actions, weights, config.network)
        found, source = read_source(run), None
        if found is not None:
            source = copy.deepcopy(before)
            source.load_state_dict(dict(found.weights))
            copy_layers(before, found.weights, run.arm)
        env = ShipEnv(case, entry.world, 1, colour=entry.colour)
        reached = rollout(env, greedy_policy(before, env.rasteriser))[0].episode_return
    except ConfigError as error:
        print_error(f"{name}: the network before training is left out: {error}")
        return Origin(result)
    if not abs(reached - result.before.episode_return) < SHOWN:
        print_error(
            f"{name}: the network before training is left out: it should return "
            f"{result.before.episode_return:.1f} and returns {reached:.1f}"
        )
        return Origin(result, source)
    layers = before.conv_names
    copied = layers[: run.arm.copied_layers(len(layers))]
    if run.arm.copies_all:
        copied = (*copied, "shared")
    return Origin(result, source, before, copied, run.arm.frozen_layers > 0)


def read_config(path: Path) -> Config:
    """Read the configuration of a run.

    Raises:
        ConfigError: the file is missing, damaged or incomplete.
    """
    try:
        values = read_yaml(path)
    except (OSError, ValueError, TypeError, OmegaConfBaseException, YAMLError) as error:
        raise ConfigError(f"{path} is not a configuration: {' '.join(str(error).split())}") from None
    return read_as(Config, values, f"{path}: ")


def make_untrained(like: DuelingNetwork, generator: Generator) -> list[DuelingNetwork]:
    """Draw networks of the same layers as `like`, with the weights that training begins with."""
    found = []
    for _ in range(UNTRAINED_NETWORKS):
        network = copy.deepcopy(like)
        network.reset(generator)
        found.append(network)
    return found


def add_controls(
    named: list[Compared], origin: Origin, untrained: list[DuelingNetwork]
) -> tuple[Compared, ...]:
    """Add the origin of the first network and untrained networks to the named ones."""
    first = named[0].name
    past = [
        (f"{first} before training", Role.before, origin.before),
        (f"source of {first}", Role.source, origin.source),
    ]
    return (
        named[0],
        *(Compared(name, role, network) for name, role, network in past if network is not None),
        *named[1:],
        *(Compared(f"untrained {k}", Role.untrained, one) for k, one in enumerate(untrained, 1)),
    )
