"""What would not fit into memory, or into numbers of 32 bits, is refused; what is just below is not."""

from pathlib import Path

import pytest

from ship_trl.config.errors import ConfigError
from tests.command import ship_trl
from tests.config.test_config import HIGH, composed

BILLION = 10**9
LARGE = {
    "learn.episodes=1000000001": "learn.episodes: must be at most 1000000000, got 1000000001",
    "learn.warmup_steps=1000000001": "learn.warmup_steps: must be at most 1000000000",
    "learn.update_every=1000000001": "learn.update_every: must be at most 1000000000",
    "learn.evaluate_every=1000000001": "learn.evaluate_every: must be at most 1000000000",
    "learn.jumpstart_draws=1000001": "learn.jumpstart_draws: must be at most 1000000, got 1000001",
    "learn.lr=2": "learn.lr: must be at most 1, got 2",
    "learn.lr_end=2": "learn.lr_end: must be at most 1, got 2",
    "learn.huber_delta=1e10": "learn.huber_delta: must be at most 1e+09",
    "learn.reward_scale=1e4": "learn.reward_scale: must be at most 1000 (with the constants of world.reward)",
    "world.reward.goal=1e6 world.reward.w1=1e6": "learn.reward_scale: must be at most 0.001 (with the",
    "learn.replay_size=1000000000000": "learn.replay_size: must be at most 143165576 (8 GB)",
    "method=feature_extraction learn.replay_size=2000000": "learn.replay_size: must be at most 6815",
    "learn.num_envs=1000000000": "learn.num_envs: must be at most 35241 (4 GB of the maps of network.conv)",
    "learn.batch_size=100000 learn.replay_size=100000": "learn.batch_size: must be at most 35241 (4 GB",
    "network.conv=[[4096,1,1],[4096,84,1]] layers=2": "network.conv: must be at most 100000000 (weights;",
    "world.dt=1e-320": "world.dt: must be from 0.001 to 1000 (seconds), got 1e-320",
    "world.dt=1e300": "world.dt: must be from 0.001 to 1000 (seconds), got 1e+300",
    "world.max_steps=1001": "world.max_steps: must be at most 1000 (the planner's memory",
    f"world.max_steps=1000 world.actions=[{','.join(['[15,0]'] * 11)}]": "world.actions: must be at most 10",
    f"world.actions=[{','.join(['[15,0]'] * 101)}]": "world.actions: must be at most 100 (their number;",
    "world.actions=[[1e-9,0]]": "world.actions: must make at least 0.001 m in a step of world.dt=1 s",
    "world.actions=[[15,0],[-1e9,0]]": "world.actions: must make at most 1e+06 m in an episode, got 6e+10",
    "world.actions=[[15,1e9]]": "world.actions: must turn by at most 10000 rad in an episode, got 6e+10",
    "world.safe_distance=1e30": "world.safe_distance: must be at most 100000 (metres), got 1e+30",
    "world.goal_distance=901": "world.goal_distance: must be at most 900 (metres that the fastest action m",
    "world.reward.k1=-1e300": "world.reward.k1: must be a finite number of at most 1e+06 in size",
}


@pytest.mark.parametrize("line", LARGE)
def test_what_is_too_large_is_refused(line: str) -> None:
    with pytest.raises(ConfigError) as caught:
        composed(*HIGH, *line.split())
    assert str(caught.value).startswith(LARGE[line]) and "\n" not in str(caught.value)


def test_what_is_large_is_not() -> None:
    large = ["learn.episodes=1000000000", "learn.replay_size=100000000", "learn.batch_size=30000"]
    world = ["world.max_steps=1000", "world.dt=60", "world.goal_distance=99999", "world.reward.goal=1e6"]
    config = composed(*HIGH, *large, *world, "learn.num_envs=30000", "learn.lr=1")
    assert config.learn.episodes == BILLION and config.world.dt == 60.0


@pytest.mark.parametrize("line", ["layers=1", "layers=2 learn.backend=dense", "layers=3 learn.backend=dense"])
def test_a_replay_of_states_may_be_large_whatever_is_frozen(line: str) -> None:
    composed("+pair=high", "method=feature_extraction", *line.split(), "learn.replay_size=1000000")


def test_it_is_refused_before_torch_is_imported(tmp_path: Path) -> None:
    first = "import atexit, sys; atexit.register(lambda: print('torch' in sys.modules))"
    line = ("target=1", "method=scratch", "learn.batch_size=100000", "learn.replay_size=100000")
    assert ship_trl(*line, folder=tmp_path, code=1, first=first, new_process=True).stdout == "False\n"
