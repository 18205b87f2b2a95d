"""Logs as other programs write them give the numbers that the programs' own readers give, or are refused."""

import json
import math
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from stable_baselines3 import DQN
from stable_baselines3.common import logger
from stable_baselines3.common.callbacks import EvalCallback
from stable_baselines3.common.monitor import Monitor, load_results
from stable_baselines3.common.vec_env import DummyVecEnv
from tensorboard.backend.event_processing.event_accumulator import EventAccumulator
from torch.utils.tensorboard import SummaryWriter

from ship_trl.config.errors import ConfigError
from ship_trl.files.logs import EVENTS, read_logs
from ship_trl.files.record import SourceReturns
from tests.a_result import a_result

# A training episode's return, length and the seconds at its end.
EPISODES = st.lists(
    st.tuples(st.integers(-99, 99), st.integers(1, 50), st.integers(0, 10**6)), min_size=2, max_size=20,
    unique_by=lambda one: one[2],
).map(lambda found: sorted(found, key=lambda one: one[2]))  # fmt: skip
# Names that info keywords of a monitor had in public logs.
KEYWORDS = ("reward", "value", "seed", "step", "return")


def read(*paths: Path | str) -> list[tuple[list[float], list[float]]]:
    return [
        (one.steps.tolist(), one.returns.tolist()) for one in read_logs([Path(path) for path in paths], "arm")
    ]


def told(*paths: Path | str) -> str:
    with pytest.raises(ConfigError, match=r"^arm: ") as caught:
        read(*paths)
    assert "\n" not in str(caught.value)
    return str(caught.value)


class Keywords(gymnasium.Wrapper):
    """Says more of an episode than its return and length."""

    def step(self, action: int) -> tuple[object, float, bool, bool, dict[str, object]]:
        state, reward, *ended, info = self.env.step(action)
        return state, float(reward), *ended, info | dict.fromkeys(KEYWORDS, 3.5)


def test_workers_of_a_run_are_what_their_writer_reads() -> None:
    def make(name: str) -> Monitor:
        env = Keywords(gymnasium.make("CartPole-v1"))
        return Monitor(env, f"logs/{name}", info_keywords=KEYWORDS)

    envs = DummyVecEnv([lambda k=k: make(str(k)) for k in range(3)])  # type: ignore[misc]
    envs.seed(0)
    envs.reset()
    rng = np.random.default_rng(0)
    for _ in range(150):
        envs.step(rng.integers(0, 2, 3))
    envs.close()
    wanted = load_results("logs")
    assert len(wanted) > 10 and wanted["index"].duplicated().any()
    found = (wanted["l"].cumsum().tolist(), wanted["r"].tolist())
    assert read(*sorted(Path("logs").iterdir())) == [found]


def write_monitor(
    path: Path, rows: Iterable[tuple[float, ...]], start: float = 0.0, names: str = "r,l,t"
) -> None:
    path.parent.mkdir(exist_ok=True)
    lines = [f"#{json.dumps({'t_start': start})}", names, *(",".join(map(str, row)) for row in rows)]
    path.write_text("\n".join(lines) + "\n")


@given(EPISODES, st.permutations(range(8)), st.data())
def test_columns_and_workers_of_a_monitor_change_no_number(
    episodes: list[tuple[int, int, int]], order: list[int], data: st.DataObject
) -> None:
    one = Path("one/monitor.csv")
    write_monitor(one, episodes)
    wanted = read(one)
    names = np.array(["r", "l", "t", *KEYWORDS])[order]
    more = [tuple(np.array([*row, *range(5)])[order]) for row in episodes]
    write_monitor(one, more, names=",".join(names))
    assert read(one) == wanted
    workers = [data.draw(st.integers(0, 2)) for _ in episodes]
    paths = [Path(f"several/{k}.monitor.csv") for k in range(3)]
    for k, path in enumerate(paths):
        write_monitor(path, [row for row, own in zip(episodes, workers, strict=True) if own == k])
    assert read(*paths) == wanted


@given(EPISODES, st.permutations(range(4)))
def test_columns_of_a_table_change_no_number(episodes: list[tuple[int, int, int]], order: list[int]) -> None:
    table = np.array([(step, number, 7, 8) for number, _, step in episodes])
    np.savetxt("table.csv", table[:, :2], "%d", ",", header="global_step,return", comments="")
    wanted = read("table.csv")
    names = np.array(["global_step", "return", "loss", "time"])[order]
    np.savetxt("more.csv", table[:, order], "%d", ";", header=";".join(names), comments="")
    assert read("more.csv") == wanted


@given(EPISODES, st.data())
def test_event_files_of_a_resumed_run_change_no_number(
    episodes: list[tuple[int, int, int]], data: st.DataObject
) -> None:
    points = [(step, float(number)) for number, _, step in episodes]
    for path in (*Path("whole").glob("*"), *Path("parts").glob("*")):
        path.unlink()
    write_events("whole", points)
    cut = data.draw(st.integers(1, len(points)))
    repeated = data.draw(st.integers(0, cut))
    write_events("parts", [(step, number + (k >= repeated)) for k, (step, number) in enumerate(points[:cut])])
    write_events("parts", points[repeated:], after=100.0)
    wanted = [(one.step, one.value) for one in scalars("whole")]
    assert read(*Path("whole").iterdir()) == [tuple(map(list, zip(*wanted, strict=True)))]
    assert read(*Path("parts").iterdir()) == read(*Path("whole").iterdir())


def write_events(
    folder: str, points: Iterable[tuple[int, float]], tag: str = "charts/episodic_return", after: float = 0.0
) -> None:
    writer = SummaryWriter(folder)
    for k, (step, number) in enumerate(points):
        writer.add_scalar(tag, number, step, walltime=1000 + after + k)
    writer.close()


def scalars(folder: str, tag: str = "charts/episodic_return") -> list:  # type: ignore[type-arg]
    return EventAccumulator(folder, {"scalars": 0}).Reload().Scalars(tag)


def test_event_files_of_runs_at_the_same_time_are_refused() -> None:
    for after in (0.0, 1.0):
        write_events("run", [(1, 2.0), (2, 3.0), (3, 4.0)], after=after)
    assert "run holds event files of several runs at the same time" in told(*Path("run").iterdir())


def test_our_event_file_counts_environment_steps() -> None:
    writer = SummaryWriter("ours")
    for episode, steps in enumerate((20, 60), 1):
        writer.add_scalar("train/return", episode * 1.5, episode)
        writer.add_scalar("train/steps", steps, episode)
    writer.close()
    assert read(*Path("ours").iterdir()) == [([20, 60], [1.5, 3.0])]


def test_what_counts_episodes_is_refused() -> None:
    write_events("old", [(1, 2.0), (2, 3.0)], tag="train/return")
    said = "train/return over something else than environment steps; allowed: the run's curve.csv"
    assert said in told(*Path("old").iterdir())
    for name, column in (
        ("run-1_scratch_seed=0-tag-train_return.csv", "Value"),
        ("run-1_scratch_seed=0-tag-greedy_return.csv", "Value"),
        ("history.csv", "train/return"),
    ):
        exported = Path(name)
        exported.write_text(f"Wall time,Step,{column}\n1.0,1,-3\n2.0,2,4\n")
        assert "counts episodes; allowed: the run's curve.csv" in told(exported)
    Path("progress.csv").write_text("time/total_timesteps,rollout/ep_rew_mean\n10,1\n20,12\n30,1")
    assert "line 4 is cut" in told(Path("progress.csv"))


def test_what_a_logger_writes_is_read_from_both_files() -> None:
    log = logger.configure("sb3", ["csv", "tensorboard"])
    # No episode has ended at first; evaluations are lines of their own.
    for step, number in ((100, np.nan), (200, 5.0), (250, None), (300, 6.5)):
        log.record("time/total_timesteps", step)
        log.record("train/loss", 0.5)
        log.record(*(("eval/mean_reward", 99.0) if number is None else ("rollout/ep_rew_mean", number)))
        log.dump(step)
    log.close()
    wanted = [([200, 300], [5.0, 6.5])]
    assert read("sb3/progress.csv") == wanted
    assert read(*Path("sb3").glob(f"{EVENTS}*")) == wanted


class Bandit(gymnasium.Env):
    """Episodes of one step; the return is the action, and 1 is a success."""

    observation_space = gymnasium.spaces.Box(0, 1, (1,))
    action_space = gymnasium.spaces.Discrete(2)

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Any, Any]:
        super().reset(seed=seed)
        return np.zeros(1, np.float32), {}

    def step(self, action: int) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        return np.zeros(1, np.float32), float(action), True, False, {"is_success": bool(action)}


def test_evaluations_are_read_as_their_writer_measured_them() -> None:
    callback = EvalCallback(Monitor(Bandit()), eval_freq=8, n_eval_episodes=3, log_path="sb3", verbose=0)
    DQN("MlpPolicy", Bandit(), learning_starts=4, train_freq=4, verbose=0, seed=0).learn(32, callback)
    kept = np.load("sb3/evaluations.npz")
    (curve,) = read_logs([Path("sb3/evaluations.npz")], "arm")
    assert curve.steps.tolist() == kept["timesteps"].tolist() == [8, 16, 24, 32]
    assert curve.returns.tolist() == kept["results"].mean(1).tolist() == curve.success_rates.tolist()
    assert curve.returns[-1] == callback.last_mean_reward


def test_other_arrays_are_refused() -> None:
    steps, pickled = np.arange(3), np.array([{}, 1, 2], object)
    np.savez("other.npz", timesteps=steps, rewards=steps)
    np.savez("flat.npz", timesteps=steps, results=steps)
    np.savez("short.npz", timesteps=steps, results=np.zeros((2, 5)))
    np.savez("pickled.npz", timesteps=steps, results=pickled)
    np.savez_compressed("packed.npz", timesteps=steps, results=np.zeros((3, 5)))
    np.save("one", steps)
    Path("one.npy").rename("one.npz")
    Path("cut.npz").write_bytes(Path("flat.npz").read_bytes()[:-9])
    Path("text.npz").write_text("step,return")
    for path in sorted(Path().glob("*.npz")):
        assert f"{path} cannot be read (" in told(path)


MONITOR = '#{"t_start": 1.5, "env_id": "x"}\nr,l,t\n1.5,10,0.1\n2.5,30,0.4\n'


@pytest.mark.parametrize(
    ("text", "wanted"),
    [
        (MONITOR, [([10, 40], [1.5, 2.5])]),
        ("\ufeff" + MONITOR, [([10, 40], [1.5, 2.5])]),
        ("Wall time,Step,Value\n1.0,100,-3\n2.0,200,4\n", [([100, 200], [-3, 4])]),
        ("seed,step,return\n7,0,1\n8,0,2\n7,10,3\n8,20,4\n", [([0, 10], [1, 3]), ([0, 20], [2, 4])]),
        ("episode,steps,epsilon,return\n0,0,1,\n1,20,1,-4\n2,50,.9,6\n", [([20, 50], [-4, 6])]),
    ],
)
def test_known_files_are_read(text: str, wanted: list[tuple[list[float], list[float]]]) -> None:
    Path("log.csv").write_text(text)
    assert read("log.csv") == wanted


@pytest.mark.parametrize(
    ("name", "text", "said"),
    [
        ("t.csv", "", "t.csv has no rows; allowed: a monitor.csv"),
        ("t.csv", "a,b\n1,2\n", "t.csv has a, b; allowed: a monitor.csv"),
        ("t.csv", "step,return\n1,2\n", "allowed: two returns or more"),
        ("t.csv", "step,return\n2,2\n1,2\n", "steps that rise"),
        ("t.csv", "step,return\n1,2\n2,nan\n", "finite numbers up to 1e+09"),
        ("t.csv", "step,return\n1,2\n2,1e300\n", "finite numbers up to 1e+09"),
        ("t.csv", "step,return,reward\n1,2,3\n", "has return and reward, of which each may be the return"),
        ("t.csv", "Step,global_step,return\n1,2,3\n", "Step and global_step, of which each may be the step"),
        ("t.csv", "seed,run,step,return\n1,1,2,3\n", "t.csv has seed and run, of which each may be the run"),
        ("t.csv", "step,return\n1,2\n2\n", "line 3 has more or fewer cells"),
        ("t.csv", "step;return\n1;2,5\n2;3\n", "no numbers step and return: could not convert string to"),
        ("t.csv", "\x00", "t.csv"),
        ("monitor.csv", "#{}\nr,l,t\n1,10,1\n2,10,2\n3,1,4", "monitor.csv cannot be read (line 5 is cut)"),
        ("curve.csv", "steps,return\n10,1\n20,2\n30,3", "curve.csv cannot be read (line 4 is cut)"),
        ("run-x-tag-losses_loss.csv", "Wall time,Step,Value\n1,1,2\n2,2,2\n", "has another scalar than"),
        ("w.csv", '"Step","a/0 - train/return"\n1,2\n', "has Step, a/0 - train/return; allowed: a"),
    ],
)  # fmt: skip
def test_what_cannot_be_known_is_named(name: str, text: str, said: str) -> None:
    Path(name).write_text(text)
    assert said in told(name)


def test_a_curve_of_ours_has_success_rates_and_with_a_result_the_forgetting() -> None:
    lines = "episode,steps,return,greedy_success_rate\n0,0,,0.5\n1,20,-4,\n2,50,6,\n2,50,,{}\n"
    path = Path("curve.csv")
    path.write_text(lines.format("1.0"))
    (curve,) = read_logs([path], "arm")
    assert curve.success_rates.tolist() == [0.5, 1.0] and math.isnan(curve.forgetting)
    a_result(on_source=SourceReturns(90.0, 0.0, 0.0, -10.0, -100.0, 100.0)).write(Path())
    assert read_logs([path], "arm")[0].forgetting == 0.5
    path.write_text(lines.format("x"))
    assert "curve.csv has no numbers greedy_success_rate" in told(path)
    assert "no file nothing.csv; allowed: a monitor.csv" in told("nothing.csv")


def test_workers_are_a_whole_run_or_refused() -> None:
    rows = [(1.0, 10, 1.0), (2.0, 10, 2.0)]
    for k in range(2):
        write_monitor(Path(f"run/{k}.monitor.csv"), rows)
    assert "run/1.monitor.csv is left out; allowed: all workers of a run" in told("run/0.monitor.csv")
    # One after another are runs of their own.
    write_monitor(Path("run/1.monitor.csv"), rows, start=50.0)
    both = ("run/0.monitor.csv", "run/1.monitor.csv")
    assert "are not workers of one run, as one began after another's end" in told(*both)
    write_monitor(Path("run/1.monitor.csv"), [*rows, (3.0, 10, 0.5)])
    assert "run/1.monitor.csv: allowed: workers with a t_start" in told(*both)
    Path("run/1.monitor.csv").unlink()
    # The seconds of a run that was continued begin anew.
    write_monitor(Path("run/0.monitor.csv"), [*rows, (3.0, 10, 0.5)])
    assert read("run/0.monitor.csv") == [([10, 20, 30], [1, 2, 3])]
    # Other names are runs of their own.
    for name in ("a", "b"):
        write_monitor(Path(f"other/{name}.monitor.csv"), rows)
    assert len(read("other/a.monitor.csv", "other/b.monitor.csv")) == 2
