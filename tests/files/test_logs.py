"""Learning curves of other libraries are read, or refused in one line."""

import math
from pathlib import Path

import pytest
import torch
from torch.utils.tensorboard import SummaryWriter

from ship_trl.config.errors import ConfigError
from ship_trl.files.logs import read_logs
from ship_trl.files.record import SourceReturns
from tests.a_result import a_result

MONITOR = '#{"t_start": 1.5, "env_id": "x"}\nr,l,t\n1.5,10,0.1\n2.5,30,0.4\n'
SCALARS = "Wall time,Step,Value\n1.0,100,-3\n2.0,200,4\n"
TABLE = "seed,step,return\n7,0,1\n8,0,2\n7,10,3\n8,20,4\n"
CURVE = "episode,steps,epsilon,return,greedy_return\n0,0,1,,5\n1,20,1,-4,\n2,50,.9,6,\n"


def read(text: str, name: str = "log.csv") -> list[tuple[list[float], list[float]]]:
    Path(name).write_text(text)
    return [(one.steps.tolist(), one.returns.tolist()) for one in read_logs([Path(name)], "arm")]


@pytest.mark.parametrize(
    ("text", "wanted"),
    [
        (MONITOR, [([10, 40], [1.5, 2.5])]),
        ("\ufeff" + MONITOR, [([10, 40], [1.5, 2.5])]),
        (SCALARS, [([100, 200], [-3, 4])]),
        (TABLE, [([0, 10], [1, 3]), ([0, 20], [2, 4])]),
        (CURVE, [([20, 50], [-4, 6])]),
    ],
)
def test_known_files_are_read(text: str, wanted: list[tuple[list[float], list[float]]]) -> None:
    assert read(text) == wanted


def test_an_event_file_is_read() -> None:
    writer = SummaryWriter("events")
    for step in (5, 9):
        writer.add_scalar("charts/episodic_return", torch.tensor(step / 2), step)
    writer.close()
    (file,) = Path("events").iterdir()
    (curve,) = read_logs([file], "arm")
    assert (curve.steps.tolist(), curve.returns.tolist()) == ([5, 9], [2.5, 4.5])


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("", "log.csv has no rows; allowed: a monitor.csv"),
        ("a,b\n1,2\n", "log.csv has a, b; allowed: a monitor.csv"),
        ("step,return\n1,2\n", "allowed: two returns or more"),
        ("step,return\n2,2\n1,2\n", "allowed: two returns or more, steps that rise"),
        ("step,return\n1,2\n2,nan\n", "allowed: two returns or more, steps that rise, finite numbers"),
        ("step,return\n1,2\n2,1e300\n", "finite numbers up to 1e+09"),
        ("step,return\n1,2\n2,x\n", "log.csv has no numbers step and return in line 3: ['2', 'x']"),
        ("step,return\n1\n", "log.csv cannot be read"),
        ("\x00", "log.csv"),
    ],
)
def test_other_files_are_refused(text: str, told: str) -> None:
    with pytest.raises(ConfigError) as caught:
        read(text)
    assert str(caught.value).startswith("arm: ") and told in str(caught.value)


def test_a_missing_file_is_refused() -> None:
    with pytest.raises(ConfigError, match=r"^arm: no file nothing.csv; allowed: a monitor.csv"):
        read_logs([Path("nothing.csv")], "arm")


def test_a_curve_of_ours_has_success_rates_and_with_a_result_the_forgetting() -> None:
    lines = "episode,steps,return,greedy_success_rate\n0,0,,0.5\n1,20,-4,\n2,50,6,\n2,50,,{}\n"
    path = Path("curve.csv")
    path.write_text(lines.format("1.0"))
    (curve,) = read_logs([path], "arm")
    assert curve.success_rates.tolist() == [0.5, 1.0] and math.isnan(curve.forgetting)
    a_result(on_source=SourceReturns(90.0, 0.0, 0.0, -10.0, -100.0, 100.0)).write(Path())
    assert read_logs([path], "arm")[0].forgetting == 0.5
    path.write_text(lines.format("x"))
    with pytest.raises(ConfigError, match=r"^arm: curve.csv has a greedy_success_rate that is no number"):
        read_logs([path], "arm")
