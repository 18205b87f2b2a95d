"""The source network of a transfer: its weights, read once, and where they came from."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from torch import Generator

from ship_trl.config.arm import USES_FUNCTION, SourceWeights
from ship_trl.learn.network import make_network
from ship_trl.policies.pretrained import PRETRAINED
from ship_trl.run.run import Run
from ship_trl.transfer.casebase import Entry
from ship_trl.transfer.layers import Weights, load_weights, permute_values


@dataclass(frozen=True)
class Source:
    """The weights that a transfer copies from, and their origin for people."""

    weights: Weights
    origin: str


def read_source(run: Run, entry: Entry | None = None) -> Source | None:
    """Read or draw the source's weights as the run's arm asks; return None for a run from scratch.

    `entry` is the source network in the case base; None if it is bundled, a file, or random.
    """
    if run.arm.is_scratch:
        return None
    config = run.config
    actions = len(config.world.actions)
    network = make_network(config.network, actions, Generator(), colour=config.colour)
    if run.arm.weights is SourceWeights.random:
        # An untrained network with the target's layers, drawn from a random stream of its own.
        network.reset(Generator().manual_seed(run.stream("random source")))
        return Source(network.state_dict(), SourceWeights.random.value)
    path, key, origin = find_file(run, entry)
    copied = run.arm.copied(network.all_layers, network.layer_names)
    # A source may have another number of actions where its Q-values are neither copied nor asked for.
    needs_all = run.arm.method in USES_FUNCTION or "advantage" in copied
    weights = load_weights(path, network, key, free=() if needs_all else ("advantage",))
    if run.arm.weights is SourceWeights.permuted:
        weights = permute_values(weights, Generator().manual_seed(run.stream("permuted source")))
    return Source(weights, origin)


def find_file(run: Run, entry: Entry | None) -> tuple[Path, str, str]:
    """Return the source network's file, the setting that error messages name, and its origin for people."""
    if run.pretrained:
        return run.pretrained.file, "source", f"{PRETRAINED}:{run.pretrained.name}"
    if entry:
        return entry.policy, "case_base", str(entry.policy)
    path = str(run.config.source_file)
    return Path(path), "source_file", path
