"""A GPU computes what a CPU does: `python -m pytest tests/test_gpu.py`. Skipped where there is none."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest
import torch
from torch import Generator, Tensor

from ship_trl.config.types import World
from ship_trl.fast.graphs import EAGER_CALLS, Captured
from ship_trl.fast.worlds import make_rasteriser, make_starts, make_step
from ship_trl.grid.compose import compose_config
from ship_trl.learn.lockstep import Lockstep
from ship_trl.learn.network import DuelingNetwork
from ship_trl.learn.train import Training
from ship_trl.run.plan import make_run
from ship_trl.run.setup import Parts, make_parts
from ship_trl.sim.cases import load_case, load_suite
from ship_trl.sim.state import initial_state
from ship_trl.sim.transition import Transition
from tests.command import ship_trl

pytestmark = pytest.mark.skipif(not torch.cuda.is_available(), reason="no GPU")
# Enough that the last calls replay a graph.
CALLS = EAGER_CALLS + 3
# A copy from the GPU in a step: whether episodes have ended, asked by environment and loop.
READS = 3


def scenes(world: World, count: int, seed: int) -> Tensor:
    """Return random encounters, some of whose ships give way."""
    return make_starts(load_suite("traffic", world), world).sample(count, Generator().manual_seed(seed))


@pytest.mark.parametrize("count", [1, 50])
@pytest.mark.parametrize(("colour", "vector_time"), [(False, 0.0), (True, 8.0)])
def test_pictures_are_those_of_the_cpu(world: World, count: int, colour: bool, vector_time: float) -> None:
    gpu = make_rasteriser(world, colour=colour, vector_time=vector_time, device="cuda")
    cpu = make_rasteriser(world, colour=colour, vector_time=vector_time, fast=False)
    for seed in range(CALLS):
        states = scenes(world, count, seed)
        difference = gpu(states.cuda()).cpu().int() - cpu(states).int()
        assert difference.abs().max() <= 2


@pytest.mark.parametrize("count", [1, 50])
def test_steps_are_those_of_the_cpu(world: World, count: int) -> None:
    gpu, cpu = make_step(world, "cuda"), Transition(world)
    for seed in range(CALLS):
        states = scenes(world, count, seed)
        action = torch.randint(len(world.actions), (count,), generator=Generator().manual_seed(seed))
        for there, here in zip(gpu(states.cuda(), action.cuda()), cpu(states, action), strict=True):
            torch.testing.assert_close(there.cpu(), here, atol=2e-3, rtol=1e-5)


def test_a_replay_returns_new_memory() -> None:
    double: Callable[[Tensor], Tensor] = Captured(lambda x: 2 * x)
    found = [double(torch.full((3,), float(n), device="cuda")) for n in range(CALLS)]
    assert [one.tolist() for one in found] == [[2.0 * n] * 3 for n in range(CALLS)]


def plan(*words: str) -> Parts:
    """Make the parts of a run from scratch on the GPU."""
    fixed = "device=cuda", "target=4", "method=scratch", "profile=smoke", "learn.jumpstart_draws=0"
    config = compose_config(*fixed, *words)
    return make_parts(make_run(config), torch.device("cuda"), None)


def advance(training: Training, steps: int) -> None:
    for _ in range(steps):
        for _event in training.advance():
            pass


@pytest.mark.parametrize("words", [(), ("algorithm=n_step",), ("observation=vector",)])
def test_graphs_learn_what_single_operations_learn(words: tuple[str, ...]) -> None:
    fast, slow = (
        plan(
            "learn.precision=fp32",
            "learn.lr_end=1e-5",
            f"fast={kind}",
            "learn.num_envs=4",
            "learn.replay_size=500",
            *words,
        )
        for kind in ("true", "false")
    )
    before = {key: value.clone() for key, value in fast.algorithm.network.state_dict().items()}
    for parts in (fast, slow):
        advance(parts.training, 60)
    assert fast.training.steps == slow.training.steps
    there, here = fast.algorithm.network.state_dict(), slow.algorithm.network.state_dict()
    for key, value in there.items():
        torch.testing.assert_close(value, here[key], atol=1e-4, rtol=1e-3)
        assert not torch.equal(value, before[key])


def test_agents_in_lockstep_learn_what_the_cpu_learns(world: World) -> None:
    words = ["target=4", "method=scratch", "learn.precision=fp32", "learn.warmup_steps=40"]
    learn = compose_config(*words, "learn.epsilon_end=1", "learn.epsilon_start=1").learn
    case = initial_state(load_case("4", world), world)
    found = []
    for device in ("cpu", "cuda"):
        networks = [DuelingNetwork(1, len(world.actions), Generator().manual_seed(seed)) for seed in (0, 1)]
        streams = [[Generator().manual_seed(10 * seed + k) for seed in (0, 1)] for k in (1, 2)]
        begin, see = case.expand(2, -1).to(device), make_rasteriser(world, device=device)
        simulated = begin, make_step(world, device), see
        capture = Captured if device == "cuda" else None
        many = Lockstep(networks, [(), ("conv1",)], *simulated, learn, 1, 4000, *streams, capture=capture)
        many.train(40 + CALLS * learn.update_every)
        assert many.updates == CALLS
        found.append(many)
    cpu, gpu = found
    for agent in range(2):
        for name, value in cpu.weights(agent).items():
            torch.testing.assert_close(gpu.weights(agent)[name].cpu(), value, atol=1e-4, rtol=1e-3)
    assert gpu.evaluate(gpu.state)[0].isfinite().all()


def test_a_step_copies_nothing_to_the_gpu_and_reads_flags_alone() -> None:
    # Case 1: nothing to collide with ends an episode early.
    parts = plan("target=1", "learn.num_envs=4", "learn.warmup_steps=8", "learn.epsilon_start=0.5")
    advance(parts.training, EAGER_CALLS + 5)
    steps, before = 3, parts.training.episode
    with torch.profiler.profile(acc_events=True) as profiled:
        advance(parts.training, steps)
    assert parts.training.episode == before, "an episode ended, whose figures are read"
    counts = {one.key: one.count for one in profiled.key_averages()}
    assert sum(count for key, count in counts.items() if "Memcpy HtoD" in key) == 0, counts
    assert sum(count for key, count in counts.items() if "Memcpy DtoH" in key) <= READS * steps, counts


def test_the_same_seed_gives_the_same_bytes(tmp_path: Path) -> None:
    words = "+pair=high", "method=finetune", "layers=3", "profile=smoke", "device=cuda"
    for name in ("one", "two"):
        ship_trl(*words, "learn.episodes=12", f"output={name}", folder=tmp_path, new_process=True)
    files = [sorted((tmp_path / name).rglob("policy.safetensors")) for name in ("one", "two")]
    assert len(files[0]) == len(files[1]) > 0
    for one, two in zip(*files, strict=True):
        assert one.read_bytes() == two.read_bytes(), one
