"""Train runs in lockstep: from plans to agents, their evaluations, and the networks that are kept."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import torch
from torch import Generator, Tensor

from ship_trl.config.types import Config
from ship_trl.fast.graphs import Captured
from ship_trl.fast.worlds import make_rasteriser, make_step
from ship_trl.learn.lockstep import Lockstep
from ship_trl.learn.network import DuelingNetwork, make_network
from ship_trl.run.plan import Run
from ship_trl.run.setup import read_source
from ship_trl.sim.cases import load_case
from ship_trl.sim.state import initial_state
from ship_trl.sim.vector import VectorObservation
from ship_trl.transfer.methods import make_method
from ship_trl.transfer.methods.base import TransferMethod
from ship_trl.transfer.methods.feature_extraction import FeatureExtraction
from ship_trl.transfer.weights import save_weights
from studies.runs import EVALUATIONS, Setting, Task, weights_path

# Places for target ships; no case has more.
PLACES = 3


def learn(
    tasks: list[Task],
    runs: list[Run],
    setting: Setting,
    folder: Path,
    visit: Callable[[Lockstep, int], None] = lambda *_: None,
    device: str = "cpu",
) -> tuple[Lockstep, list[Tensor], list[Tensor]]:
    """Train runs at once; return the agents, and greedy returns and goals [K, 1] of each evaluation.

    `visit` is called after each. The best networks of sources are written into the folder.
    """
    begin = starts(runs, [task.target for task in tasks]).to(device)
    length = tasks[0].length(setting)
    lockstep, networks = make_lockstep(runs, begin, length)
    greedy, reached = list[Tensor](), list[Tensor]()
    best = torch.full((len(tasks), 1), -torch.inf, dtype=torch.float64)
    for evaluation in range(EVALUATIONS + 1):
        lockstep.train(evaluation * length // EVALUATIONS - lockstep.steps)
        returns, goals = lockstep.evaluate(begin[:, None])
        greedy.append(returns)
        reached.append(goals)
        visit(lockstep, evaluation)
        for agent in (returns >= best)[:, 0].nonzero().flatten().tolist():
            if tasks[agent].is_source:
                network, task = networks[agent], tasks[agent]
                network.load_state_dict(lockstep.weights(agent))
                save_weights(weights_path(folder, task.target, task.seed), network, {})
        best = torch.maximum(best, returns)
    return lockstep, greedy, reached


def make_lockstep(runs: list[Run], begin: Tensor, length: int) -> tuple[Lockstep, list[DuelingNetwork]]:
    """Make agents that begin in states [K, S], and their initial networks."""
    config, device = runs[0].config, begin.device
    networks, frozen = zip(*map(start_network, runs), strict=True)
    lockstep = Lockstep(
        networks,
        frozen,
        begin,
        make_step(config.world, device),
        make_observe(config, device),
        config.learn,
        config.algorithm.get("steps", 1),
        length,
        *([Generator().manual_seed(run.stream(name)) for run in runs] for name in ("exploration", "replay")),
        capture=Captured if device.type == "cuda" else None,
    )
    return lockstep, list(networks)


def make_observe(config: Config, device: torch.device) -> Callable[[Tensor], Tensor]:
    """Make what a network sees of states."""
    if config.network.linear:
        return VectorObservation(config.world, config.network.ships)
    return make_rasteriser(config.world, vector_time=config.network.vector_time, device=device)


def starts(runs: list[Run], cases: list[str]) -> Tensor:
    """Return the initial state of a case for each run, [K, S]."""
    worlds = [run.config.world for run in runs]
    states = [
        initial_state(load_case(case, world, "target"), world, PLACES)
        for case, world in zip(cases, worlds, strict=True)
    ]
    return torch.stack(states)


def start_network(run: Run) -> tuple[DuelingNetwork, tuple[str, ...]]:
    """Make the initial network of a run, and name its frozen layers."""
    weights = Generator().manual_seed(run.stream("weights"))
    network = make_network(run.config.network, len(run.config.world.actions), weights)
    method, source = make_method(run.arm, run.config.transfer), read_source(run)
    if type(method) not in (TransferMethod, FeatureExtraction):
        raise ValueError(f"arm {run.arm} cannot be trained in lockstep")
    if source is not None:
        method.copy(network, source.weights)
    return network, network.layer_names[: method.frozen_layers(0.0)]
