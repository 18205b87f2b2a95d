"""Each example runs as its first lines say."""

import json
import math
import sys
from functools import partial
from pathlib import Path
from subprocess import CompletedProcess
from typing import Any, cast

import numpy as np
import pytest
import torch
from PIL import Image
from tensordict import TensorDict
from torch.distributions import Categorical
from torchrl.data.replay_buffers.samplers import prioritized
from torchrl.modules import QValueActor
from torchrl.objectives import SoftUpdate

from ship_trl.cli.evaluate import main
from ship_trl.learn.double_dqn import DoubleDQN
from ship_trl.learn.train import train
from ship_trl.sim.cases import load_suite, load_world
from tests.command import ROOT, SMOKE, ship_trl
from tests.forked import run_script
from tests.formats.traffic import CROSSING, make, write
from tests.learn.worlds import Corridor, corridor_setup, schedule

# Whether TorchRL's compiled extension loads.
HAS_TREES = prioritized.SumSegmentTreeFp32 is not None

EXAMPLES = sorted((ROOT / "examples").glob("*.py"))
DRAWS = {"huber_threshold": "huber_threshold.png"}
ARGUMENTS = {
    "huber_threshold": [DRAWS["huber_threshold"]],
    "own_loss": ["200"],
    "stock_torchrl": ["--steps", "400"],
    "gymnasium_sb3": ["--steps", "300"],
    "sources_in_pandas": [str(ROOT / "outputs/sources/numbers.csv.xz"), "FTW"],
    "study_in_pandas": [str(ROOT / "outputs/confirmatory/report/runs.csv")],
}
# Builders of algorithms, which the command takes, and those that have a test of their own.
OTHERS = ("own_algorithm", "prioritised_replay", "sb3_extractor", "imazu_two_readings", "ais_encounter")
MAX_LINES = 80


def run_with(name: str, *overrides: str, folder: Path, code: int = 0) -> CompletedProcess[str]:
    """Train with the algorithm of an example."""
    build = f"algorithm.build='{ROOT / 'examples' / name}.py:build'"
    return ship_trl(*SMOKE, "target=2", "method=scratch", build, *overrides, folder=folder, code=code)


@pytest.mark.parametrize("path", [one for one in EXAMPLES if one.stem not in OTHERS], ids=lambda p: p.stem)
def test_an_example_runs(path: Path, tmp_path: Path) -> None:
    if path.stem == "foreign_encounters":
        pytest.importorskip("trafficgen", reason="trafficgen is not installed")
    ended = run_script(path, *ARGUMENTS.get(path.stem, []), folder=tmp_path)
    assert ended.code == 0, ended
    if path.stem in DRAWS:
        picture = np.asarray(Image.open(tmp_path / DRAWS[path.stem]))
        assert picture.std() > 5


def test_an_algorithm_of_ones_own_trains(tmp_path: Path) -> None:
    run_with("own_algorithm", folder=tmp_path)
    assert (tmp_path / "outputs/smoke/2/scratch/seed=0/policy.safetensors").is_file()


def test_the_soft_target_is_that_of_munchausen_dqn() -> None:
    sys.path.insert(0, str(ROOT / "examples"))
    from own_algorithm import ALPHA, TEMPERATURE, MunchausenDQN

    network = torch.nn.Linear(2, 7)
    learner = without_parts(MunchausenDQN, network)
    batch = two_steps()
    policy = Categorical(logits=network(batch["pixels"]) / TEMPERATURE)
    after = Categorical(logits=network(batch["next", "pixels"]) / TEMPERATURE)
    bonus = ALPHA * (TEMPERATURE * policy.log_prob(batch["action"])).clamp(min=-1.0)
    value = (after.probs * network(batch["next", "pixels"])).sum(-1) + TEMPERATURE * after.entropy()
    wanted = batch["next", "reward"].squeeze(-1) + bonus + 0.9 * value * torch.tensor([0.0, 1.0])
    error = network(batch["pixels"]).gather(-1, batch["action"][:, None]).squeeze(-1) - wanted
    torch.testing.assert_close(learner.loss(batch), error.square().mean(), rtol=1e-4, atol=1e-5)


def without_parts(kind: type[DoubleDQN], network: torch.nn.Module) -> DoubleDQN:
    """Return an algorithm that has only what its loss reads."""
    learner = object.__new__(kind)
    values = {"online_network": network, "target_network": network, "observed": "pixels", "learn": schedule()}
    vars(learner).update(values)
    return learner


def two_steps() -> TensorDict:
    """Return two transitions, the first of which ends its episode."""
    generator = torch.Generator().manual_seed(0)
    state, following = torch.rand(2, 2, 2, generator=generator)
    ended = torch.tensor([[True], [False]])
    after = {"pixels": following, "reward": torch.ones(2, 1), "terminated": ended}
    return TensorDict({"pixels": state, "action": torch.tensor([1, 2]), "next": after}, batch_size=[2])


def test_prioritised_replay_is_refused_where_its_extension_does_not_load(tmp_path: Path) -> None:
    found = run_with("prioritised_replay", folder=tmp_path, code=0 if HAS_TREES else 1)
    if not HAS_TREES:
        error = found.stderr
        assert error.count("\n") == 1 and "algorithm.build: prioritised replay needs TorchRL's C++" in error


def test_weights_of_transitions_weigh_their_errors() -> None:
    sys.path.insert(0, str(ROOT / "examples"))
    from prioritised_replay import PrioritisedDQN

    network = torch.nn.Linear(2, 7)
    learner, plain = (without_parts(kind, network) for kind in (PrioritisedDQN, DoubleDQN))
    batch = two_steps().set("weight", torch.ones(2, 1))
    torch.testing.assert_close(learner.loss(batch), plain.loss(batch))
    errors = batch["td_error"].squeeze(-1)
    batch["weight"] = torch.tensor([[1.0], [0.0]])
    torch.testing.assert_close(learner.loss(batch), errors[0].square() / 2)


class Tree:
    """A slow stand-in for TorchRL's compiled segment trees: sums, or least values."""

    def __init__(self, capacity: int, neutral: float) -> None:
        self.values = torch.full((capacity,), neutral)
        self.reduce = torch.sum if neutral == 0 else torch.amin

    def __getitem__(self, index: Any) -> torch.Tensor:
        return self.values[index]

    def __setitem__(self, index: Any, value: Any) -> None:
        self.values[index] = torch.as_tensor(value, dtype=torch.float32)

    def query(self, start: int, end: int) -> float:
        return float(self.reduce(self.values[start:end]))

    def scan_lower_bound(self, mass: torch.Tensor) -> torch.Tensor:
        return torch.searchsorted(self.values.cumsum(0), mass.float())


@pytest.fixture
def trees(monkeypatch: pytest.MonkeyPatch) -> None:
    """Give TorchRL's sampler slow trees, because its compiled ones may not load."""
    for bits in (32, 64):
        for name, neutral in (("Sum", 0.0), ("Min", math.inf)):
            monkeypatch.setattr(prioritized, f"{name}SegmentTreeFp{bits}", partial(Tree, neutral=neutral))


def test_large_errors_are_drawn_more_often_and_a_checkpoint_keeps_them(trees: None) -> None:
    sys.path.insert(0, str(ROOT / "examples"))
    from prioritised_replay import build

    learn = schedule(episodes=12, replay_size=100)
    one, other = (build(corridor_setup(seed, learn, options={"alpha": 1.0})) for seed in (0, 1))
    assert list(train(Corridor(3), Corridor(1), one, learn))
    memory: Any = one.replay
    memory.update_priority(torch.arange(100), torch.full((100,), 1e-3))
    memory.update_priority(torch.tensor([7]), torch.tensor([1.0]))
    state = {key: value.clone() for key, value in one.state_dict().items()}
    batch = memory.sample(2000)
    share = (batch["index"] == 7).float().mean()
    assert float(share) == pytest.approx(1 / 1.099, abs=0.03)
    weight = batch["weight"][batch["index"] == 7]
    assert float(weight[0]) == pytest.approx(1e-3**0.4, rel=1e-3) and batch["weight"].max() == 1
    other.load_state_dict(state)
    again = other.replay.sample(2000)
    assert torch.equal(batch["index"], again["index"]) and torch.equal(batch["weight"], again["weight"])
    other.learn_from(again)
    assert float(cast(Any, other.replay).sampler._sum_tree[7]) != 1.0


@pytest.mark.parametrize("words", [(), ("--freeze",)])
def test_a_frozen_extractor_does_not_learn(words: tuple[str, ...], tmp_path: Path) -> None:
    ended = run_script(ROOT / "examples/sb3_extractor.py", "--steps", "200", *words, folder=tmp_path)
    assert f"{0 if words else 8} of 8 tensors of the extractor changed" in ended.out, ended


def test_two_readings_that_are_one_differ_in_nothing(tmp_path: Path) -> None:
    """Our Imazu problems, written as NTNU's scenarios."""
    for case in load_suite("imazu", load_world()).cases:
        places = [(*case.start, case.heading, 15.0), (*case.goal, 0.0, 0.0)]
        places += [(ship.x, ship.y, ship.heading, ship.speed) for ship in case.target_ships]
        # North and east in metres at sea, speed, course.
        states = [[12.35 * y, 12.35 * x, speed, (90 - turn) % 360] for x, y, turn, speed in places]
        ships = [{"csog_state": state} for state in (states[0], *states[2:])]
        ships[0]["goal_csog_state"] = states[1]
        (tmp_path / f"{case.name}.yaml").write_text(f"ship_list: {json.dumps(ships)}\n")
    ended = run_script(ROOT / "examples/imazu_two_readings.py", str(tmp_path), folder=tmp_path)
    assert ended.code == 0 and "In 22 of 22 problems the classes agree." in ended.out, ended
    assert " / " not in ended.out and ended.out.count("\n| ") == 22


def test_an_encounter_of_a_table_is_drawn(tmp_path: Path) -> None:
    write(tmp_path / "day.csv", make(CROSSING), "danish")
    words = str(tmp_path / "day.csv"), str(tmp_path / "encounter.png"), "1"
    assert run_script(ROOT / "examples/ais_encounter.py", *words, folder=tmp_path).code == 0
    assert np.asarray(Image.open(tmp_path / "encounter.png")).std() > 5


def test_torchrl_alone_takes_few_lines() -> None:
    assert len((ROOT / "examples" / "stock_torchrl.py").read_text().splitlines()) <= MAX_LINES


def test_the_example_loss_is_pessimistic() -> None:
    sys.path.insert(0, str(ROOT / "examples"))
    from own_loss import CautiousLoss

    network = torch.nn.Linear(2, 7)
    loss = CautiousLoss(QValueActor(network, in_keys=["pixels"], action_space="categorical"), gamma=0.0)
    SoftUpdate(loss, tau=0.1)
    state, action = torch.rand(2, 2), torch.tensor([1, 2])
    q = network(state).gather(-1, action[:, None]).detach()
    after = {"pixels": state, "reward": q + torch.tensor([[1.0], [-1.0]]), "terminated": torch.ones(2, 1) > 0}
    batch = TensorDict({"pixels": state, "action": action, "next": after}, batch_size=[2])
    # A mean of 1 for the first, which is too low by 1, and of 2 for the second.
    assert float(loss(batch)["loss"].detach()) == pytest.approx(1.5)


def test_a_collision_is_forgotten_with_a_small_threshold() -> None:
    sys.path.insert(0, str(ROOT / "examples"))
    from huber_threshold import COLLISION, settled

    for share in (0.1, 0.25):
        assert settled(1.0, share) == pytest.approx(-share / (1 - share), abs=0.05)
        assert settled(10.0, share) == pytest.approx(-10 * share / (1 - share), abs=0.05)
        assert settled(20.0, share) == pytest.approx(COLLISION * share, abs=0.05)


def test_the_example_policy_gives_way(capsys: pytest.CaptureFixture[str]) -> None:
    main([f"{ROOT / 'examples/own_policy.py'}:policy", "keep_course", "target=4", "--markdown"])
    own, kept = capsys.readouterr().out.splitlines()[2:4]
    assert "| goal |" in own and "| collision |" in kept
