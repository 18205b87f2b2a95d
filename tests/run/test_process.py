"""How a run uses the machine."""

import os
import platform
import subprocess
import sys
import threading
from pathlib import Path

import pytest

from ship_trl.run.experiment import run_experiment
from ship_trl.run.plan import make_run
from ship_trl.run.process import processor_name
from tests.config.test_config import composed

# Weights of 64 MB are to be written where 0, 10, 20 ... MB are left.
LITTLE_MEMORY = """
import resource
import sys
from pathlib import Path
import torch
from ship_trl.files.disk import write_tensors
from ship_trl.run.process import configure_process

configure_process()
write_tensors(Path(sys.argv[1]), {"weight": torch.zeros(1)}, {})
weights = {"weight": torch.zeros(16 * 2**20)}
_, most = resource.getrlimit(resource.RLIMIT_AS)
for left in range(0, 260, 10):
    pages = int(Path("/proc/self/statm").read_text().split()[0])
    resource.setrlimit(resource.RLIMIT_AS, (pages * resource.getpagesize() + left * 2**20, most))
    try:
        write_tensors(Path(sys.argv[1]), weights, {})
        print("written")
    except MemoryError:
        print("no memory")
"""


@pytest.mark.skipif(sys.platform != "linux", reason="Linux says how much memory is mapped")
def test_without_memory_for_weights_an_error_is_raised(tmp_path: Path) -> None:
    # For a backtrace Rust needs memory, and deadlocks without it.
    asked = {**os.environ, "RUST_BACKTRACE": "1"}
    done = subprocess.run(
        [sys.executable, "-c", LITTLE_MEMORY, str(tmp_path / "weights.safetensors")],
        env=asked,
        capture_output=True,
        text=True,
        timeout=120,
    )
    said = done.stdout.splitlines()
    assert done.returncode == 0 and said[0] == "no memory" and said[-1] == "written", done


def resident() -> float:
    """Return the resident memory of this process in MB."""
    status = Path("/proc/self/status").read_text()
    return int(status.partition("VmRSS:")[2].split()[0]) / 1024


@pytest.mark.parametrize(
    ("cpuinfo", "told"),
    [
        ("cpu family\t: 26\nmodel\t\t: 2\nmodel name\t: AMD EPYC\n", "AMD EPYC (family 26, model 2)"),
        # Arm processors have no model name.
        ("processor\t: 0\nCPU architecture: 8\n", platform.processor() or platform.machine()),
    ],
)
def test_the_processor_is_named(
    cpuinfo: str | None, told: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    if cpuinfo is not None:
        (tmp_path / "cpuinfo").write_text(cpuinfo)
    monkeypatch.setattr("ship_trl.run.process.CPUINFO", tmp_path / "cpuinfo")
    assert processor_name() == told != ""


@pytest.mark.long
@pytest.mark.skipif(sys.platform != "linux", reason="Linux says how much memory is used")
def test_runs_in_one_process_leave_no_memory_files_or_threads(tmp_path: Path) -> None:
    measured = []
    for seed in range(8):
        arm = ("+pair=high", "+arm=FE3") if seed % 4 == 3 else ("target=4", "method=scratch")
        small = ("profile=smoke", "learn.episodes=30", "checkpoint.seconds=0")
        run_experiment(make_run(composed(*small, *arm, f"seed={seed}", f"output={tmp_path}/out")))
        measured.append((resident(), len([*Path("/proc/self/fd").iterdir()]), threading.active_count()))
    warm, last = measured[3], measured[-1]
    assert last[0] < 1.05 * warm[0] and last[1] <= warm[1] + 2 and last[2] <= warm[2]
    assert [path.name for path in tmp_path.iterdir()] == ["out"]
