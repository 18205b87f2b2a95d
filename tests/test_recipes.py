"""The recipes of CONTRIBUTING.md that change code, followed in a copy, and what the real commands then do."""

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
from omegaconf import OmegaConf

from tests.command import ROOT
from tests.study.synthetic import learning, write_run

RECIPES = {line.strip() for line in (ROOT / "CONTRIBUTING.md").read_text().splitlines()}
MOST_FILES = 3
SMOKE = (
    "ship_trl",
    "target=2",
    "method=scratch",
    "profile=smoke",
    "learn.episodes=3",
    "learn.jumpstart_draws=0",
)
REWARD = "ship_trl/sim/reward.py"
RESULT = "outputs/smoke/2/scratch/seed=0"
# Every action in many states near ship and goal, paid by the compiled loop and by torch.
PAY = """
import json, torch
from ship_trl.sim.cases import load_case, load_world
from ship_trl.sim.fast.compiled import CompiledStep
from ship_trl.sim.transition import Transition
world = load_world()
step = Transition(load_case("4", world), world, torch.device("cpu"))
place = torch.tensor([[0.0, 0.0], [300.0, 300.0], [0.0, 550.0], [0.0, 590.0]]).repeat_interleave(7, 0)
state = torch.cat((place, torch.tensor([[1.6, 5.0]]).expand(28, 2)), 1)
action = torch.arange(7).repeat(4)
print(json.dumps([s(state, action).reward.tolist() for s in (CompiledStep(step), step)]))
"""


def follow(folder: Path, *edits: tuple[str, str, str]) -> Path:
    """Copy the package and its values, with the loops that were compiled, and edit the copy.

    Args:
        folder: where to put it.
        edits: file, what stands there, and what takes its place, whose new lines the recipe must give.
    """
    place = folder / "copy"
    for name in ("ship_trl", "conf"):
        shutil.copytree(ROOT / name, place / name, dirs_exist_ok=True)
    change(place, *edits)
    return place


def change(place: Path, *edits: tuple[str, str, str]) -> None:
    """Make the edits of one recipe."""
    assert len({file for file, _, _ in edits}) <= MOST_FILES
    for file, old, new in edits:
        text = (place / file).read_text()
        assert text.count(old) == 1, f"{file} has no such place, or many: {old}"
        (place / file).write_text(text.replace(old, new))
        added = {line.strip() for line in new.splitlines()} - {line.strip() for line in old.splitlines()}
        assert added - {""} <= RECIPES


def python(place: Path, folder: Path, *line: str) -> str:
    """Standard output of Python with the copy of the package, in a folder."""
    environment = os.environ | {"PYTHONPATH": str(place), "OMP_NUM_THREADS": "1", "COLUMNS": "200"}
    # Compiled loops are kept beside their files.
    environment.pop("NUMBA_CACHE_DIR", None)
    folder.mkdir(exist_ok=True)
    done = subprocess.run(
        [sys.executable, *line], cwd=folder, env=environment, capture_output=True, text=True, timeout=300
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def rewards(place: Path) -> list[list[float]]:
    """What steps are paid, by the compiled loop and by torch."""
    return json.loads(python(place, place, "-c", PAY))


def dearer(paid: list[list[float]], costs: list[float]) -> list[Any]:
    """Rewards of `PAY` less the cost of each action."""
    many = costs * (len(paid[0]) // len(costs))
    return [pytest.approx([p - c for p, c in zip(row, many, strict=True)], abs=1e-4) for row in paid]


def curve(folder: Path) -> list[dict[str, str]]:
    with (folder / RESULT / "curve.csv").open() as lines:
        return list(csv.DictReader(lines))


@pytest.fixture(scope="module")
def before(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a run of the package as it is."""
    folder = tmp_path_factory.mktemp("before")
    python(ROOT, folder, "-m", *SMOKE)
    return folder


@pytest.mark.long
def test_a_reward_term(before: Path, tmp_path: Path) -> None:
    place, folder = follow(tmp_path), tmp_path / "after"
    paid = rewards(place)
    terms = "    return shaping + goal * reached + collision * collided"
    change(
        place,
        ("ship_trl/config/types.py", "    k2: float\n", "    k2: float\n    rudder: float = 0.0\n"),
        (REWARD, "        180.0 / math.pi,\n", "        180.0 / math.pi,\n        reward.rudder,\n"),
        (
            REWARD,
            "    goal, collision, per_metre, per_degree, degrees = constants\n",
            "    goal, collision, per_metre, per_degree, degrees, rudder = constants\n",
        ),
        (REWARD, f"{terms}\n", f"{terms} + rudder * abs(turn)\n"),
    )
    # The paper's world has none of it.
    assert rewards(place) == dearer(paid, [0.0] * 7)
    world = "defaults: [paper, _self_]\nreward:\n  rudder: -10.0\n"
    assert {line.strip() for line in world.splitlines()} <= RECIPES
    (place / "conf/world/mine.yaml").write_text(world)
    for line, lost in ((["world=mine"], 0.5), (["world=mine", "world.reward.rudder=-1000"], 100)):
        python(place, folder, "-m", *SMOKE, *line, "overwrite=true")
        # Before anything is learned, the same is sailed and paid less.
        for first, second in zip(curve(before)[:2], curve(folder)[:2], strict=True):
            key = "greedy_return" if first["greedy_return"] else "return"
            assert float(second.pop(key)) < float(first.pop(key)) - lost and first == second
    assert "rudder: -1000" in (folder / RESULT / "config.yaml").read_text()


def test_an_edited_formula_is_used_though_compiled_loops_are_kept(tmp_path: Path) -> None:
    place = follow(tmp_path)
    paid = rewards(place)
    assert list((place / "ship_trl/sim/__pycache__").glob("reward.write_rewards-*.nbi"))
    path = place / REWARD
    path.write_text(path.read_text().replace("+ goal", "- turn * turn - speed * (nearest < 1e5) + goal"))
    actions = OmegaConf.load(place / "conf/world/paper.yaml").actions
    assert rewards(place) == dearer(paid, [turn * turn + speed for speed, turn in actions])


def test_a_loss(before: Path, tmp_path: Path) -> None:
    formula = (
        "    if kind is Loss.log_cosh:  # but for a constant\n"
        "        return torch.logaddexp(q - td_target, td_target - q).mean()\n"
    )
    words = 'Loss = Enum("Loss", ["l2", "huber"'
    place, folder = follow(tmp_path), tmp_path / "after"
    change(
        place,
        ("ship_trl/config/types.py", f"{words}])", f'{words}, "log_cosh"])'),
        ("ship_trl/learn/loss.py", "    raise ValueError(", f"{formula}    raise ValueError("),
    )
    python(place, folder, "-m", *SMOKE, "learn.loss=log_cosh")
    first, second = curve(before), curve(folder)
    assert [line["return"] for line in first[:2]] == [line["return"] for line in second[:2]]
    squared, other = (next(float(x["loss"]) for x in lines if x["loss"]) for lines in (first, second))
    # A small error costs half its square, and the constant is log 2.
    assert other - math.log(2) == pytest.approx(squared / 2, rel=0.3)
    assert "loss: log_cosh" in (folder / RESULT / "config.yaml").read_text()


def test_a_metric(before: Path, tmp_path: Path) -> None:
    function = (
        "def worst(record: Record) -> float:\n"
        '    """Return the lowest greedy score of a run."""\n'
        "    return float(np.min(record.score(record.greedy.returns)))\n\n\n"
    )
    metrics = "METRICS: dict[str, Callable[[Record], float]] = {\n"
    edit = "ship_trl/study/analysis/metrics.py", metrics, f'{function}{metrics}    "worst": worst,\n'
    python(follow(tmp_path, edit), before, "-m", "ship_trl", "results", "outputs", "--csv", "numbers.csv")
    with (before / "numbers.csv").open() as lines:
        (row,) = csv.DictReader(lines)
    result = json.loads((before / RESULT / "result.json").read_text())
    known, random = result["best_known_return"], result["random_return"]
    lowest = min(float(line["greedy_return"]) for line in curve(before) if line["greedy_return"])
    assert float(row["worst"]) == pytest.approx((lowest - random) / (known - random), rel=1e-3)


def test_a_claim(tmp_path: Path) -> None:
    rng, folder = np.random.default_rng(0), tmp_path / "study"
    for arm, end in (("scratch", 0.5), ("FE3", 1.0)):
        for seed in range(5):
            write_run(folder / "pairs", learning(rng, 60, end, half=5), arm=arm, seed=seed)
    contrast = 'beats("high", "scratch", "FE3", "collisions")'
    claim = f'    Hypothesis("E7", EXPLORATORY, "FE3 collides less.", [{contrast}]),\n'
    edit = "ship_trl/study/claims/conclusions.py", "OURS = [\n", f"OURS = [\n{claim}"
    tables = []
    for place in (ROOT, follow(tmp_path, edit)):
        python(place, tmp_path, "-m", "ship_trl", "report", "study")
        with (folder / "report/claims.csv").open() as lines:
            tables.append(list(csv.DictReader(lines)))
    (row,) = (row for row in tables[1] if row["claim"] == "E7")
    assert row["metric"] == "collisions" and float(row["estimate"]) > 0.2
    assert "FE3 collides less." in (folder / "report/index.html").read_text()
    # It changes no other verdict.
    assert tables[0] == [other for other in tables[1] if other is not row]


def test_a_measure_of_similarity(tmp_path: Path) -> None:
    value = "abs(len(base.target_ships) - len(target.target_ships))"
    line = f'    "ships": Measure(lambda base, target, _: {value}, nearer=True),\n'
    place = follow(tmp_path, ("ship_trl/transfer/similarity.py", "MEASURES = {\n", f"MEASURES = {{\n{line}"))
    said = python(place, tmp_path, "-m", "ship_trl", "cases", "--target", "4", "--by", "ships")
    assert "Sources for case 4, by ships" in said
