"""Suites: their files, here or bundled, which cases they name, and the initial states that they draw."""

import math
from dataclasses import replace
from functools import partial
from pathlib import Path

import pytest
import torch
from torch import Generator
from torchrl.envs import ParallelEnv, SerialEnv
from torchrl.envs.batched_envs import BatchedEnvBase

from ship_trl.config.errors import ConfigError
from ship_trl.config.paths import conf_dir, conf_files
from ship_trl.config.types import World
from ship_trl.fast.worlds import make_env, make_starts
from ship_trl.sim.cases import (
    Perturbation,
    load_case,
    load_suite,
    profile_of,
    shadowing_file,
    suite_of,
)
from ship_trl.sim.env import ShipEnv
from ship_trl.sim.starts import Starts
from ship_trl.sim.state import (
    GOAL_X,
    GOAL_Y,
    HEADING,
    SHIP_COUNT,
    SHIP_SPEED,
    SHIP_X,
    SHIP_Y,
    X,
    Y,
    goal_distance,
    relative_positions,
    target_ships,
)

BOUNDS = Perturbation(own_position=30.0, own_heading=20.0, ship_position=100.0, ship_speed=5.0)


def draw(seed: int = 0) -> Generator:
    return Generator().manual_seed(seed)


@pytest.mark.parametrize("name", sorted(conf_files("suite")))
def test_every_suite_loads_and_draws(name: str, world: World) -> None:
    assert len(make_starts(load_suite(name, world), world).sample(3, draw())) == 3


def test_a_case_is_a_suite_of_one_and_draws_nothing(world: World) -> None:
    suite, generator = load_suite("4", world), draw()
    before = generator.get_state()
    states = Starts(suite, world).sample(3, generator)
    assert suite.is_fixed and torch.equal(generator.get_state(), before)
    assert bool((states == states[0]).all())


def test_a_fingerprint_is_of_cases_and_perturbation(world: World) -> None:
    case = load_case("4", world)
    one, paper = load_suite("4", world), load_suite("paper", world)
    assert one.fingerprint == case.fingerprint
    others = [
        suite_of(case, Perturbation(own_position=50)),
        suite_of(case, Perturbation(own_heading=50)),
        paper,
        replace(paper, cases=paper.cases[:-1]),
        replace(paper, perturbation=BOUNDS),
    ]
    assert len({suite.fingerprint for suite in (one, *others)}) == 6
    assert suite_of(case, Perturbation(own_position=50.0)).fingerprint == others[0].fingerprint
    assert replace(one, name="another").fingerprint == one.fingerprint


def test_perturbed_starts_stay_in_their_bounds(world: World) -> None:
    suite = replace(suite_of(load_case("6", world)), perturbation=BOUNDS)
    starts = Starts(suite, world)
    states, start = starts.sample(500, draw()), starts.states[0]
    change = (states - start).abs()
    assert float(change[:, [X, Y]].max()) <= 30 and float(change[:, [X, Y]].max()) > 25
    assert float(change[:, HEADING].max()) <= math.radians(20) + 1e-5
    ships = target_ships(change)
    assert float(ships[..., :2].max()) <= 100 + 1e-3 and float(ships[..., SHIP_SPEED].max()) <= 5 + 1e-5
    assert not bool(change[:, [GOAL_X, GOAL_Y, SHIP_COUNT]].any())
    assert bool((relative_positions(states).norm(dim=-1) >= world.safe_distance).all())
    assert bool((goal_distance(states) > world.goal_distance).all())


def test_a_seed_stays_a_scene_however_much_a_state_remembers(world: World) -> None:
    """Figures of perturbed suites, and the kept tables of the studies, hold for these starts."""
    states = Starts(load_suite("paper_perturbed", world), world).balanced(7, draw(5))
    assert states[3, [X, Y, HEADING]].tolist() == pytest.approx([-12.78137, -10.63399, 1.65338], abs=1e-4)
    ships = target_ships(states[3])[:, [SHIP_X, SHIP_Y, SHIP_SPEED]].tolist()
    assert ships[0] == pytest.approx([262.02933, 459.11829, 14.35200], abs=1e-4)
    assert ships[1] == pytest.approx([389.98093, 596.81576, 15.92197], abs=1e-4)
    assert states[5, :2].tolist() == pytest.approx([-4.99966, -7.37944], abs=1e-4)


def test_balanced_starts_take_the_cases_in_turn(world: World) -> None:
    suite = load_suite("paper", world)
    starts, generator = Starts(suite, world), draw()
    before = generator.get_state()
    states = starts.balanced(16, generator)
    assert torch.equal(states, starts.states[torch.arange(16) % 7])
    assert torch.equal(generator.get_state(), before)
    perturbed = Starts(replace(suite, perturbation=BOUNDS), world)
    moved = perturbed.balanced(16, generator)
    assert torch.equal(moved[:, SHIP_COUNT], states[:, SHIP_COUNT])
    assert float((moved - states)[:, [X, Y]].abs().max()) <= 30
    assert torch.equal(moved, perturbed.balanced(16, draw()))
    assert len({row.numpy().tobytes() for row in moved}) == 16


def test_a_perturbation_that_leaves_no_start_is_refused(world: World) -> None:
    near = replace(load_case("1", world), goal=[0.0, 61.0])
    wide = replace(suite_of(near), perturbation=Perturbation(own_position=0.5))
    tight = replace(world, goal_distance=100.0)
    with pytest.raises(ConfigError, match="perturbation: too large"):
        Starts(wide, tight).sample(5, draw())


@pytest.mark.parametrize("kind", [SerialEnv, pytest.param(ParallelEnv, marks=pytest.mark.long)])
def test_workers_see_other_scenes_and_a_seed_repeats_them(kind: type[BatchedEnvBase], world: World) -> None:
    make = partial(ShipEnv, load_suite("paper_perturbed", world), world, 1)
    workers, other = kind(2, make), kind(2, make)
    unseeded = [env.reset()["state"] for env in (workers, other)]
    assert len({scene.numpy().tobytes() for rows in unseeded for scene in rows}) == 4
    seeded = []
    for env in (workers, other):
        env.set_seed(3)
        seeded.append(env.reset()["state"])
        env.close()
    assert torch.equal(*seeded) and not torch.equal(seeded[0][0], seeded[0][1])


def test_a_perturbed_batch_and_its_resets_equal_single_environments(world: World) -> None:
    suite = replace(load_suite("paper", world), perturbation=BOUNDS)
    count, actions, ended = 12, draw(3), 0
    env = make_env(suite, world, count, from_pixels=True, generator=draw(1))
    single, starts, chance = make_env(suite, world, 1, from_pixels=True), Starts(suite, world), draw(1)
    current, states = env.reset(), env.begun(starts.sample(count, chance))
    alone = [single.reset().set("state", row[None]) for row in states]
    for row in alone:
        row.set("pixels", single.rasteriser(row["state"]))
    for _ in range(90):
        for n, row in enumerate(alone):
            for key in row.keys():  # noqa: SIM118
                assert torch.equal(current[key][n], row[key][0]), key
        action = torch.randint(7, (count,), generator=actions)
        action[0] = 3  # a timeout or a collision, so that rows end at different steps
        stepped, current = env.step_and_maybe_reset(current.set("action", action))
        ends = stepped["next", "done"].squeeze(-1)
        begun, ended = iter(env.begun(starts.sample(int(ends.sum()), chance))), ended + int(ends.sum())
        for n, row in enumerate(alone):
            after = single.step(row.set("action", action[n : n + 1]))["next"]
            for key in after.keys():  # noqa: SIM118
                assert torch.equal(stepped["next", key][n], after[key][0]), key
            alone[n] = after.exclude("reward")
            if bool(ends[n]):
                state = next(begun)[None]
                alone[n] = single.reset().update({"state": state, "pixels": single.rasteriser(state)})
    assert ended > count


def test_an_unknown_suite_is_refused(world: World) -> None:
    with pytest.raises(ConfigError, match="suite: no case or suite everything; allowed: 1, 2"):
        load_suite("everything", world)


def test_a_suite_of_the_working_directory_comes_before_a_bundled_one(
    world: World, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    bundled = load_suite("traffic", world).traffic
    (tmp_path / "conf/suite").mkdir(parents=True)
    text = (conf_dir() / "suite/traffic.yaml").read_text().replace("reacting: 0.3 ", "reacting: 1 ")
    (tmp_path / "conf/suite/traffic.yaml").write_text(text)
    (tmp_path / "conf/suite/two.yaml").write_text("cases: ['1', '2']")
    monkeypatch.chdir(tmp_path)
    own = load_suite("traffic", world).traffic
    assert bundled is not None and own is not None and (bundled.reacting, own.reacting) == (0.3, 1)
    assert [case.name for case in load_suite("two", world).cases] == ["1", "2"]
    (tmp_path / "conf/suite/two.yaml").write_text("cases: ['1', '22']")
    with pytest.raises(ConfigError, match=r"^conf/suite/two.yaml: cases: no case 22"):
        load_suite("two", world)
    (tmp_path / "conf/suite/two.yaml").write_text("cases: ['1'")
    for read in (lambda: load_suite("two", world), lambda: profile_of("two")):
        with pytest.raises(ConfigError, match=r"^conf/suite/two.yaml: not readable as YAML: "):
            read()
    with pytest.raises(ConfigError, match=r"^conf/suite/two.yaml: not readable as YAML: "):
        load_suite("conf/suite/two.yaml", world)
    for text in ("cases: ['1']", "based_on: traffic"):
        (tmp_path / "conf/suite/two.yaml").write_text(text)
        with pytest.raises(
            ConfigError, match=r"^conf/suite/two.yaml: holds a suite; allowed: a case's file, or"
        ):
            load_suite("conf/suite/two.yaml", world)
    assert shadowing_file("suite", "traffic") == Path("conf/suite/traffic.yaml")
    assert shadowing_file("suite", "two") is None


def test_a_suite_takes_what_it_leaves_out_from_the_one_it_is_based_on(
    world: World, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "conf/suite").mkdir(parents=True)
    monkeypatch.chdir(tmp_path)
    own = tmp_path / "conf/suite/own.yaml"
    own.write_text("based_on: traffic_near\ntraffic:\n  reacting: 0.5\n  ships: [0, 1]\n")
    below, above = load_suite("traffic_near", world).traffic, load_suite("own", world).traffic
    assert below is not None and above == replace(below, reacting=0.5, ships=[0, 1])
    assert profile_of("own") == "traffic"
    for wrong in ("nothing", "own", "traffic_dense", "[1, 2]", "../suite/traffic", "traffic\ntraffic: [1]"):
        own.write_text(f"based_on: {wrong}\n")
        with pytest.raises(ConfigError, match=r"^conf/suite/own.yaml: based_on: "):
            load_suite("own", world)
    own.write_text("based_on: traffic_test\n")
    assert len(load_suite("own", world).cases) == 500
    # A bundled suite keeps its base, and a file may be based on the bundled one of its name.
    (tmp_path / "conf/suite/traffic_near.yaml").write_text("based_on: traffic_near\ntraffic:\n  ships: [1]\n")
    ours, theirs = load_suite("traffic_near", world).traffic, load_suite("traffic_reacting", world).traffic
    assert ours == replace(below, ships=[1]) and theirs == replace(below, reacting=1)
