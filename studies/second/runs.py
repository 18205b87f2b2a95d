"""Train the runs of the second study, and test their last networks on other scenes."""

from __future__ import annotations

import shutil
import subprocess
import sys
import time
from collections.abc import Sequence
from functools import cache
from pathlib import Path

import torch
import torch.nn.functional as F
from tensordict import TensorDict
from torch import Generator, Tensor

from ship_trl.config.errors import ConfigError
from ship_trl.fast.worlds import make_env, make_tracked_step
from ship_trl.files.disk import atomic_write
from ship_trl.learn.lockstep import Lockstep, roll_out
from ship_trl.policies.named import load_policy
from ship_trl.run.lockstep import PLACES, learn, starts
from ship_trl.sim.cases import load_case, load_suite, load_world, suite_of
from ship_trl.sim.encounter import Tracker
from ship_trl.sim.starts import Starts
from ship_trl.sim.state import initial_state, state_size
from studies.lockstep import EVALUATIONS, Row, Task, make_row, paths_to_keep, weights_path
from studies.second.plan import FIRST_SOURCE, IMAZU, TRAFFIC, TRAFFIC_SEEDS

# Drawn starts of a target, the same for all runs.
STARTS, STARTS_SEED = 50, 2022
# Episodes of `traffic_test` at once.
AT_ONCE = 100


def train(tasks: list[Task], overrides: Sequence[str], folder: Path, device: str = "cpu") -> list[Row]:
    """Train runs of one length and one learner at once, and test their last networks elsewhere.

    `perturbed`, `replayed` and `traffic` are shares of episodes that reach the goal: from drawn starts of the
    target; from the same starts, with the actions of the greedy episode from the undisturbed one; and in
    `traffic_test`. Those of sources are not tested, and 0.
    """
    began = time.process_time()
    runs = [task.plan(overrides, folder) for task in tasks]
    kept = paths_to_keep(tasks, folder)
    agents, greedy, reached = learn(runs, tasks[0].length, EVALUATIONS, kept, device=device)
    tested = dict.fromkeys(("perturbed", "replayed", "traffic"), torch.zeros(len(tasks), 1))
    if not tasks[0].is_source:
        homes = starts(runs, [task.target for task in tasks])[:, None].to(device)
        drawn = torch.stack([drawn_starts(task.target) for task in tasks]).to(device)
        scenes = traffic_starts().to(device).expand(len(tasks), -1, -1)
        tested = {
            "perturbed": agents.evaluate(drawn)[1],
            "replayed": replay_actions(agents, homes, drawn),
            "traffic": torch.cat([agents.evaluate(part)[1] for part in scenes.split(AT_ONCE, 1)], 1),
        }
    shares = {name: one.float().mean(1).tolist() for name, one in tested.items()}
    seconds = (time.process_time() - began) / len(tasks)
    return [
        make_row(task, greedy[k].tolist(), reached[k].tolist(), (), seconds)
        | {"learner": task.learner, **{name: round(share[k], 4) for name, share in shares.items()}}
        for k, task in enumerate(tasks)
    ]


def replay_actions(agents: Lockstep, home: Tensor, begin: Tensor) -> Tensor:
    """Run episodes with the actions of each agent's greedy episode from `home[k]` [1, S].

    After the last of these actions it is repeated. Agent k begins in the states `begin[k]` [M, S]. Return
    whether the goal is reached, bool [K, M].
    """
    _, _, actions = roll_out(agents.step, home, lambda state, _: agents.greedy_actions(state))
    again = lambda state, step: actions[min(step, len(actions) - 1)].expand(state.shape[:-1])  # noqa: E731
    return roll_out(agents.step, begin, again)[1].cpu()


@cache
def drawn_starts(target: str) -> Tensor:
    """Return drawn starts of a case, [STARTS, S], by the bounds of its suite of perturbed starts."""
    world = load_world()
    bounds = load_suite("imazu_perturbed" if target in IMAZU else "paper_perturbed", world).perturbation
    suite = suite_of(load_case(target, world, "target"), bounds)
    drawn = Starts(suite, world).sample(STARTS, Generator().manual_seed(STARTS_SEED))
    begin = F.pad(drawn, (0, state_size(PLACES) - drawn.shape[1]))
    return Tracker(world)(begin, begin)


def traffic_starts() -> Tensor:
    """Return the initial states of `traffic_test`, [episodes, S]."""
    world = load_world()
    begin = torch.stack(
        [initial_state(case, world, PLACES) for case in load_suite("traffic_test", world).cases]
    )
    return Tracker(world)(begin, begin)


def learn_traffic(overrides: Sequence[str], folder: Path) -> None:
    """Train the networks of random encounters that are missing, by the profile of such runs.

    Raises:
        ConfigError: a run failed; it has said why.
    """
    network = [word for word in overrides if word.startswith(("observation=", "network."))]
    for seed in range(FIRST_SOURCE, FIRST_SOURCE + TRAFFIC_SEEDS):
        output, kept = folder / "runs", weights_path(folder, TRAFFIC, seed)
        if kept.exists():
            continue
        words = ["target=traffic_near", "method=scratch", f"seed={seed}", f"output={output}", *network]
        if subprocess.run([sys.executable, "-m", "ship_trl", *words], check=False).returncode:
            raise ConfigError(f"studies: the run from {TRAFFIC} with seed {seed} failed")
        (made,) = output.rglob(f"seed={seed}/policy.safetensors")
        with atomic_write(kept) as draft:
            shutil.copy(made, draft)


@cache
def policy_success(name: str, target: str | None) -> float:
    """Return how often a policy reaches the goal from the drawn starts of a case; None: in `traffic_test`."""
    world = load_world()
    policy = load_policy(name, make_env(load_suite("1", world), world, 1))

    def choose(state: Tensor, _: int) -> Tensor:
        flat = state.flatten(0, 1)
        acted = policy(TensorDict({"state": flat}, batch_size=[len(flat)]))
        return acted["action"].view(state.shape[:2])

    begin = traffic_starts() if target is None else drawn_starts(target)
    return float(roll_out(make_tracked_step(world), begin[None], choose)[1].float().mean())
