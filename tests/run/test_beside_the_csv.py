"""`logger=all`: wandb and TensorBoard get the numbers and pictures, and a run prints where they are."""

import csv
import signal
from pathlib import Path

import numpy as np
import pytest
from tensorboard.backend.event_processing.event_accumulator import EventAccumulator
from tensorboard.plugins.hparams.plugin_data_pb2 import HParamsPluginData

from tests.command import KEYS, files, ship_trl

LINE = ("profile=smoke", "target=1", "method=scratch", "learn.batch_size=8", "learn.jumpstart_draws=0")
RUN = "1/scratch/seed=0"
START = "_hparams_/session_start_info"


@pytest.fixture(scope="module")
def logged(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, str]:
    """Return the output folder of a run that logs to all, and its text; its environment holds keys."""
    folder = tmp_path_factory.mktemp("logged")
    with pytest.MonkeyPatch.context() as patch:
        for name, key in KEYS.items():
            patch.setenv(name, key)
        # wandb keeps a log of its own there.
        patch.setenv("WANDB_CACHE_DIR", str(folder / "outputs/smoke/cache"))
        done = ship_trl(*LINE, "logger=all", folder=folder)
    return folder / "outputs/smoke", done.stdout + done.stderr


@pytest.fixture(scope="module")
def events(logged: tuple[Path, str]) -> EventAccumulator:
    """Return what TensorBoard reads in the run's folder."""
    found = EventAccumulator(str(logged[0] / RUN), size_guidance={"scalars": 0, "images": 0, "tensors": 0})
    return found.Reload()


def test_tensorboard_has_the_numbers_of_the_csv(logged: tuple[Path, str], events: EventAccumulator) -> None:
    with (logged[0] / RUN / "curve.csv").open() as file:
        rows = list(csv.DictReader(file))
    for column, name in (
        ("return", "train/return"),
        ("loss", "train/loss"),
        ("greedy_return", "greedy/return"),
    ):
        written = {int(row["episode"]): float(row[column]) for row in rows if row[column]}
        shown = {scalar.step: scalar.value for scalar in events.Scalars(name)}
        assert written and shown == {step: np.float32(value) for step, value in written.items()}


def test_tensorboards_hparams_hold_the_settings_in_the_same_run(
    logged: tuple[Path, str], events: EventAccumulator
) -> None:
    assert not list((logged[0] / RUN).glob("*/events.out*"))
    found = events.summary_metadata.keys()
    data = HParamsPluginData.FromString(events.summary_metadata[START].plugin_data.content)
    settings = data.session_start_info.hparams
    assert settings["arm"].string_value == "scratch" and settings["algo"].string_value == "double_dqn"
    assert settings["learn.batch_size"].number_value == 8 and settings["seed"].number_value == 0
    # It would fix the columns of a whole grid.
    assert "_hparams_/experiment" not in found and "_hparams_/session_end_info" in found
    assert {"best/return", "best/success_rate"} <= set(events.Tags()["scalars"])


def test_a_run_prints_where_it_was_logged(logged: tuple[Path, str]) -> None:
    output, said = logged
    (run,) = (output / "wandb").glob("offline-run-*")
    name = f"outputs/smoke/wandb/{run.name}"
    assert f"wandb: {name}; to upload it: wandb sync {name}\n" in said
    assert f"tensorboard: outputs/smoke/{RUN}; to see it: tensorboard --logdir outputs/smoke\n" in said


def test_no_key_is_written_or_printed(logged: tuple[Path, str]) -> None:
    """Not even into wandb's own logs and the file that is uploaded later."""
    output, said = logged
    found = files(output)
    assert any(name.endswith("debug.log") for name in found) and any(n.endswith(".wandb") for n in found)
    for key in KEYS.values():
        assert key not in said
        assert not [name for name, data in found.items() if key.encode() in data]


# wandb takes seconds to start.
@pytest.mark.parametrize(
    ("number", "logger"),
    [(signal.SIGTERM, "tensorboard"), pytest.param(signal.SIGINT, "all", marks=pytest.mark.long)],
)
def test_a_stopped_run_is_logged_once(number: signal.Signals, logger: str, tmp_path: Path) -> None:
    line = (*LINE, f"logger={logger}")
    first = (
        "import signal\n"
        # A process in the background may ignore it.
        "signal.signal(signal.SIGINT, signal.default_int_handler)\n"
        "from ship_trl.run import trackers\n"
        "log, seen = trackers.Trackers.log, []\n"
        "def counted(tracker, event):\n"
        "    log(tracker, event)\n"
        "    seen.append(event)\n"
        f"    len(seen) != 5 or signal.raise_signal({int(number)})\n"
        "trackers.Trackers.log = counted"
    )
    stopped = ship_trl(*line, folder=tmp_path, code=128 + number, first=first)
    words = "stopped at episode 3 of 6; run the same command again to resume from episode 3"
    assert stopped.stderr == f"ship_trl: {words}\n"
    said = ship_trl(*line, folder=tmp_path).stdout
    assert "resuming from the checkpoint at episode 3 of 6" in said
    output = tmp_path / "outputs/smoke"
    if logger == "all":
        (run,) = (output / "wandb").glob("offline-run-*")
        assert f"wandb sync outputs/smoke/wandb/{run.name}" in said
    with (output / RUN / "curve.csv").open() as file:
        returns = [float(line["return"]) for line in csv.DictReader(file) if line["return"]]
    shown = EventAccumulator(str(output / RUN), size_guidance={"scalars": 0}).Reload().Scalars("train/return")
    assert [scalar.step for scalar in shown] == [1, 2, 3, 4, 5, 6]
    assert [scalar.value for scalar in shown] == [np.float32(value) for value in returns]
