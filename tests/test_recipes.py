"""The recipes of CONTRIBUTING.md that change code fit it, and the real commands then do what they say."""

import csv
import json
import math
import os
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.command import ROOT
from tests.study.synthetic import learning, write_run

LINES = {line.strip() for line in (ROOT / "CONTRIBUTING.md").read_text().splitlines()}
MAX_FILES = 3
SMOKE = (
    "ship_trl",
    "target=2",
    "method=scratch",
    "profile=smoke",
    "learn.episodes=3",
    "learn.jumpstart_draws=0",
)
RESULT = "outputs/smoke/2/scratch/seed=0"
WORLD = "defaults: [paper, _self_]\nreward:\n  rudder: -10.0\n"
COLLISION = "reward.w2 * reward.collision, lambda amount, step: amount * step.collided\n    ),\n"
RUDDER = '    "rudder": Term(lambda reward: reward.rudder, lambda amount, step: amount * abs(step.turn)),\n'
LOSSES = 'Loss = StrEnum("Loss", ["l2", "huber"'
METRICS = "METRICS: dict[str, Callable[[RunRecord], float]] = {\n"
LOSS = """\
    if kind is Loss.log_cosh:  # but for a constant
        return torch.logaddexp(q - td_target, td_target - q).mean()
"""
METRIC = '''\
def worst(record: RunRecord) -> float:
    """Return the lowest greedy score of a run."""
    return float(np.min(record.score(record.greedy.returns)))


'''
CONTRAST = 'beats("high", "scratch", "FE3", "collisions")'
CLAIM = f'    Claim("E7", EXPLORATORY, "FE3 collides less.", [{CONTRAST}]),\n'
HEADINGS = '"headings": Measure(lambda base, target, _: abs(base.heading - target.heading), nearer=True),'
VECTOR_TIME = "    vector_time: bounds.Seconds = 0.0\n"
COUNTED = "return bounds.OWN_NUMBERS + self.encounters + self.crowd"
INIT = "    def __init__(self, world: World, ships: int, encounters: bool = False) -> None:\n"
CROWD_INIT = """\
    def __init__(
        self, world: World, ships: int, encounters: bool = False, crowd: bool = False
    ) -> None:
        self.crowd = crowd
"""
SHOWN = "        return torch.cat((torch.stack(own, -1), "
CROWD = """\
        if self.crowd:
            own = (*own, state[..., col.SHIP_COUNT] / 8)
"""
CROWD_NETWORK = "defaults: [vector]\ncrowd: true\n"
# What the recipe of a method gives, in a file with its imports.
METHOD = '''\
from ship_trl.config.arm import Form
from ship_trl.transfer.methods.base import TransferMethod

FORM = Form("HV")


class Method(TransferMethod):
    """Copies the arm's layers at half their size."""

    def copy(self, network, weights):
        super().copy(network, {name: value / 2 for name, value in weights.items()})
'''
# By recipe: file, what stands there, what takes its place; the recipe gives every new line, but the vector's.
RECIPES = {
    "reward": [
        (
            "ship_trl/config/types.py",
            "    k2: bounds.Coefficient\n",
            "    k2: bounds.Coefficient\n    rudder: bounds.Coefficient = 0.0\n",
        ),
        ("ship_trl/sim/reward.py", COLLISION, COLLISION + RUDDER),
    ],
    "loss": [
        ("ship_trl/config/types.py", f"{LOSSES}])", f'{LOSSES}, "log_cosh"])'),
        ("ship_trl/learn/q_learning.py", "    raise ValueError(", f"{LOSS}    raise ValueError("),
    ],
    "vector": [
        ("ship_trl/config/types.py", VECTOR_TIME, f"{VECTOR_TIME}    crowd: bool = False\n"),
        ("ship_trl/config/types.py", "return bounds.OWN_NUMBERS + self.encounters\n", f"{COUNTED}\n"),
        ("ship_trl/sim/vector.py", INIT, CROWD_INIT),
        (
            "ship_trl/sim/vector.py",
            "return cls(world, network.ships, network.encounters)",
            "return cls(world, network.ships, network.encounters, network.crowd)",
        ),
        ("ship_trl/sim/vector.py", SHOWN, CROWD + SHOWN),
    ],
    "metric": [("ship_trl/study/metrics.py", METRICS, f'{METRIC}{METRICS}    "worst": worst,\n')],
    "claim": [("studies/paper/claims.py", "OURS = [\n", f"OURS = [\n{CLAIM}")],
    "similarity": [
        (
            "ship_trl/transfer/similarity.py",
            "MEASURES = {\n",
            f"MEASURES = {{\n    {HEADINGS}\n",
        )
    ],
}
# Every action in many states near ship and goal, paid by the compiled loop and by torch.
PAY = """
import json, torch
from ship_trl.sim.cases import load_case, load_world
from ship_trl.fast.step import CompiledStep
from ship_trl.sim.state import HEADING, STEP, initial_state, position
from ship_trl.sim.transition import Transition
world = load_world()
step = Transition(world)
place = torch.tensor([[0.0, 0.0], [300.0, 300.0], [0.0, 550.0], [0.0, 590.0]]).repeat_interleave(7, 0)
state = initial_state(load_case("4", world), world).repeat(28, 1)
position(state).copy_(place)
state[:, [HEADING, STEP]] = torch.tensor([1.6, 5.0])
action = torch.arange(7).repeat(4)
print(json.dumps([s(state, action).reward.tolist() for s in (CompiledStep(step), step)]))
"""


def copy(folder: Path) -> Path:
    """Copy the package, its values and the claims, with the loops that were compiled."""
    for name in ("ship_trl", "conf", "studies"):
        shutil.copytree(ROOT / name, folder / "copy" / name)
    return folder / "copy"


def follow(recipe: str, place: Path) -> Path:
    """Follow a recipe in a copy."""
    for file, old, new in RECIPES[recipe]:
        path = place / file
        assert path.read_text().count(old) == 1, f"{file} has no such place, or many: {old}"
        path.write_text(path.read_text().replace(old, new))
    return place


def python(place: Path, folder: Path, *line: str) -> str:
    """Run Python with a copy of the package in a folder, and return what it prints."""
    environment = os.environ | {"PYTHONPATH": str(place), "OMP_NUM_THREADS": "1", "COLUMNS": "200"}
    # Compiled loops are kept beside their files.
    environment.pop("NUMBA_CACHE_DIR", None)
    folder.mkdir(exist_ok=True)
    line = (sys.executable, *line)
    done = subprocess.run(line, cwd=folder, env=environment, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def curve(folder: Path) -> list[dict[str, Any]]:
    with (folder / RESULT / "curve.csv").open() as lines:
        return list(csv.DictReader(lines))


@pytest.mark.parametrize("recipe", RECIPES)
def test_a_recipe_fits_the_code_and_is_short(recipe: str, tmp_path: Path) -> None:
    edits = RECIPES[recipe]
    for file in {file for file, _, _ in edits}:
        (tmp_path / file).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(ROOT / file, tmp_path / file)
    follow(recipe, tmp_path)
    assert len({file for file, _, _ in edits}) <= MAX_FILES
    for _, old, new in edits:
        added = {line.strip() for line in new.splitlines()} - {line.strip() for line in old.splitlines()}
        assert recipe == "vector" or added - {""} <= LINES
    assert {line.strip() for line in WORLD.splitlines()} <= LINES


@pytest.fixture(scope="module")
def before(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a run of the package as it is."""
    folder = tmp_path_factory.mktemp("before")
    python(ROOT, folder, "-m", *SMOKE)
    return folder


@pytest.mark.long
def test_a_reward_term(before: Path, tmp_path: Path) -> None:
    place, folder = copy(tmp_path), tmp_path / "after"
    # The loops compiled before the edit are kept, and not used after it. The paper's world has no such term.
    before_edit = json.loads(python(place, place, "-c", PAY))
    assert list((place / "ship_trl").rglob("step.write_rewards-*.nbi"))
    after_edit = json.loads(python(follow("reward", place), place, "-c", PAY))
    for first, second in zip(before_edit, after_edit, strict=True):
        assert second == pytest.approx(first, abs=1e-4)
    (place / "conf/world/mine.yaml").write_text(WORLD)
    for line, lost in ((["world=mine"], 0.5), (["world=mine", "world.reward.rudder=-1000"], 100)):
        python(place, folder, "-m", *SMOKE, *line, "overwrite=true")
        # Before anything is learned, the same actions are taken and paid less.
        for first, second in zip(curve(before)[:2], curve(folder)[:2], strict=True):
            key = "greedy_return" if first["greedy_return"] else "return"
            assert float(second.pop(key)) < float(first.pop(key)) - lost and first == second
    assert "rudder: -1000" in (folder / RESULT / "config.yaml").read_text()


@pytest.mark.long
def test_a_loss(before: Path, tmp_path: Path) -> None:
    folder = tmp_path / "after"
    python(follow("loss", copy(tmp_path)), folder, "-m", *SMOKE, "learn.loss=log_cosh")
    first, second = curve(before), curve(folder)
    assert [line["return"] for line in first[:2]] == [line["return"] for line in second[:2]]
    squared, other = (next(float(x["loss"]) for x in lines if x["loss"]) for lines in (first, second))
    # A small error costs half its square, and the constant is log 2.
    assert other - math.log(2) == pytest.approx(squared / 2, rel=0.3)
    assert "loss: log_cosh" in (folder / RESULT / "config.yaml").read_text()


@pytest.mark.long
def test_a_number_of_the_vector(tmp_path: Path) -> None:
    place, folder = follow("vector", copy(tmp_path)), tmp_path / "after"
    (place / "conf/network/crowd.yaml").write_text(CROWD_NETWORK)
    python(place, folder, "-m", *SMOKE, "observation=vector", "network=crowd")
    line = ("evaluate", RESULT, "pretrained:traffic", "target=2")
    assert "pretrained:traffic" in python(place, folder, "-m", "ship_trl", *line)
    assert "crowd: true" in (folder / RESULT / "config.yaml").read_text()


@pytest.mark.long
def test_a_metric(before: Path, tmp_path: Path) -> None:
    line = ("-m", "ship_trl", "results", "outputs", "--csv", "numbers.csv")
    python(follow("metric", copy(tmp_path)), before, *line)
    with (before / "numbers.csv").open() as lines:
        (row,) = csv.DictReader(lines)
    result = json.loads((before / RESULT / "result.json").read_text())
    known, random = result["best_known_return"], result["random_return"]
    lowest = min(float(line["greedy_return"]) for line in curve(before) if line["greedy_return"])
    assert float(row["worst"]) == pytest.approx((lowest - random) / (known - random), rel=1e-3)


@pytest.mark.long
def test_a_claim(tmp_path: Path) -> None:
    rng, folder = np.random.default_rng(0), tmp_path / "study"
    for arm, end in (("scratch", 0.5), ("FE3", 1.0)):
        for seed in range(5):
            write_run(folder / "pairs", learning(rng, 60, end, half=5), arm=arm, seed=seed)
    tables = []
    for place in (ROOT, follow("claim", copy(tmp_path))):
        claims = str(place / "studies/paper/claims.py")
        python(place, tmp_path, "-m", "ship_trl", "study", "report", "study", "--claims", claims)
        with (folder / "report/claims.csv").open() as lines:
            tables.append(list(csv.DictReader(lines)))
    (row,) = (row for row in tables[1] if row["claim"] == "E7")
    assert row["metric"] == "collisions" and float(row["estimate"]) > 0.2
    assert "FE3 collides less." in (folder / "report/index.html").read_text()
    # It changes no other verdict.
    assert tables[0] == [other for other in tables[1] if other is not row]


@pytest.mark.long
def test_a_measure_of_similarity(tmp_path: Path) -> None:
    place = follow("similarity", copy(tmp_path))
    printed = python(place, tmp_path, "-m", "ship_trl", "cases", "target=4", "--by", "headings")
    assert "Sources for case 4, by headings" in printed


@pytest.mark.long
def test_a_method_of_transfer(tmp_path: Path) -> None:
    place, folder = copy(tmp_path), tmp_path / "after"
    (place / "ship_trl/transfer/methods/halve.py").write_text(METHOD)
    given = {line.strip() for line in METHOD.splitlines() if not line.startswith("from ")}
    assert given - LINES == {"def copy(self, network, weights):"}
    python(place, folder, "-m", "ship_trl", "+pair=high", "arm=HV3", *SMOKE[3:])
    assert (folder / "outputs/smoke/high/HV3/seed=0/result.json").is_file()
