"""The replay is preloaded with demonstrations before training."""

from pathlib import Path

from hydra import compose, initialize_config_dir
from torch import Generator

from ship_trl.config.checks import to_config
from ship_trl.config.paths import conf_dir
from ship_trl.fast.worlds import make_env
from ship_trl.learn.double_dqn import build
from ship_trl.learn.network import DuelingNetwork
from ship_trl.policies.demonstrations import write_demonstration
from ship_trl.policies.reference import best_known
from ship_trl.run.plan import make_run
from ship_trl.run.setup import show_demonstrations
from ship_trl.sim.cases import load_case, load_world
from tests.learn.worlds import fast_setup


def test_every_step_of_a_demonstration_is_stored_once(tmp_path: Path) -> None:
    world = load_world()
    case = load_case("4", world)
    plan = best_known(case, world)
    for _ in range(2):
        write_demonstration(tmp_path, case, world, plan.actions, (plan.episode_return, "goal"), "planner")
    with initialize_config_dir(str(conf_dir()), version_base="1.3"):
        words = ["target=4", "method=scratch", f"demonstrations={tmp_path}"]
        run = make_run(to_config(compose("config", words)))
    env, replay = make_env(case, world, 3), Generator().manual_seed(0)
    network = DuelingNetwork(1, 7, Generator().manual_seed(0))
    setup = fast_setup(network, env.rasteriser, 7, run.config.learn, Generator(), replay)
    algorithm = build(setup)
    # Three ships repeat the actions, and the steps of one are kept.
    show_demonstrations(run, env, algorithm)
    assert algorithm.updates == algorithm.steps == 0
    assert len(algorithm.replay) == 2 * len(plan.actions)
    rows = algorithm.replay[:]
    assert rows["action"].tolist() == 2 * plan.actions
    assert abs(float(rows["next", "reward"].sum()) * 10 - 2 * plan.episode_return) < 1e-2
    assert int(rows["next", "done"].sum()) == 2
