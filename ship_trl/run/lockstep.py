"""Train planned runs in lockstep: their agents and evaluations, and the networks that are kept."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

import torch
from torch import Generator, Tensor

from ship_trl.config.errors import require
from ship_trl.fast.graphs import Captured
from ship_trl.fast.worlds import make_rasteriser, make_tracked_step
from ship_trl.learn.lockstep import Lockstep
from ship_trl.learn.network import DuelingNetwork, make_network
from ship_trl.run.plan import Run
from ship_trl.run.setup import read_source
from ship_trl.sim.cases import load_case
from ship_trl.sim.encounter import Tracker
from ship_trl.sim.state import initial_state
from ship_trl.sim.vector import VectorObservation
from ship_trl.transfer.methods import feature_extraction, make_method
from ship_trl.transfer.methods.base import TransferMethod
from ship_trl.transfer.weights import save_weights

# Places for target ships; no case has more.
PLACES = 3


def learn(
    runs: Sequence[Run],
    length: int,
    evaluations: int,
    keep: Sequence[Path | None],
    visit: Callable[[Lockstep, int], None] = lambda *_: None,
    device: str = "cpu",
) -> tuple[Lockstep, Tensor, Tensor]:
    """Train runs for `length` environment steps; return agents, greedy returns and goals, [K, E + 1] each.

    There are `evaluations` at equal distances, and one before training; `visit` is called after each. The
    network of a run's best evaluation is written to its path in `keep`, if it has one.
    """
    begin = starts(runs, [str(run.config.target) for run in runs]).to(device)
    lockstep, networks = make_lockstep(runs, begin, length)
    greedy, reached = list[Tensor](), list[Tensor]()
    best = torch.full((len(runs), 1), -torch.inf, dtype=torch.float64)
    for evaluation in range(evaluations + 1):
        lockstep.train(evaluation * length // evaluations - lockstep.steps)
        returns, goals = lockstep.evaluate(begin[:, None])
        greedy.append(returns)
        reached.append(goals)
        visit(lockstep, evaluation)
        for agent in (returns >= best)[:, 0].nonzero().flatten().tolist():
            if (path := keep[agent]) is not None:
                networks[agent].load_state_dict(lockstep.weights(agent))
                save_weights(path, networks[agent], {})
        best = torch.maximum(best, returns)
    return lockstep, torch.cat(greedy, 1), torch.cat(reached, 1)


def make_lockstep(
    runs: Sequence[Run], begin: Tensor, length: int
) -> tuple[Lockstep, tuple[DuelingNetwork, ...]]:
    """Make agents that begin in states [K, S], and their initial networks."""
    config, device = runs[0].config, begin.device
    networks, frozen = zip(*map(start_network, runs), strict=True)
    network, world = config.network, config.world
    lockstep = Lockstep(
        networks,
        frozen,
        begin,
        make_tracked_step(world, device),
        VectorObservation.of(network, world)
        if network.linear
        else make_rasteriser(world, vector_time=network.vector_time, device=device),
        config.learn,
        config.algorithm.get("steps", 1),
        length,
        *([Generator().manual_seed(run.stream(name)) for run in runs] for name in ("exploration", "replay")),
        capture=Captured if device.type == "cuda" else None,
    )
    return lockstep, networks


def starts(runs: Sequence[Run], cases: Sequence[str]) -> Tensor:
    """Return the initial state of a case for each run, [K, S]."""
    worlds = [run.config.world for run in runs]
    states = [
        initial_state(load_case(case, world, "target"), world, PLACES)
        for case, world in zip(cases, worlds, strict=True)
    ]
    begin = torch.stack(states)
    return Tracker(worlds[0])(begin, begin)


def start_network(run: Run) -> tuple[DuelingNetwork, tuple[str, ...]]:
    """Make the initial network of a run, and name its frozen layers.

    Raises:
        ConfigError, ValueError: the run has a mask, or an arm that cannot be in lockstep.
    """
    require(run.config.mask is None, "mask", "null for runs in lockstep", run.config.mask)
    weights = Generator().manual_seed(run.stream("weights"))
    network = make_network(run.config.network, len(run.config.world.actions), weights)
    method, source = make_method(run.arm, run.config.transfer), read_source(run)
    if type(method) not in (TransferMethod, feature_extraction.Method):
        raise ValueError(f"arm {run.arm} cannot be trained in lockstep")
    if source is not None:
        method.copy(network, source.weights)
    return network, network.layer_names[: method.frozen_layers(0.0)]
