"""Faults made on purpose: a kill, a full disk, a damaged file, two commands at once.

Each command runs in a folder of its own, on two cases of ten steps.
"""

import errno
import itertools
import os
import random
import resource
import shutil
import signal
import sys
from collections.abc import Callable
from functools import cache
from pathlib import Path
from tempfile import mkdtemp

import pytest

from tests.command import DRAFT, contents
from tests.forked import Running, run

CASES = {
    "near": "start: [0, 0]\nheading: 90\ngoal: [0, 180]\nideal_path: straight\ntarget_ships: []\n",
    "met": (
        "start: [0, 0]\nheading: 90\ngoal: [0, 185]\nideal_path: starboard\n"
        "target_ships: [{x: 60, y: 120, heading: 180, speed: 5}]\n"
    ),
}
# Episodes of ten steps, and a checkpoint after each.
SHORT = (
    *("profile=smoke", "world.max_steps=10", "learn.warmup_steps=20", "learn.jumpstart_draws=2"),
    *("learn.episodes=3", "learn.evaluate_every=2", "learn.batch_size=8", "checkpoint.seconds=0"),
    *("network.conv=[[8,8,4],[8,4,2],[8,3,1],[20,7,1]]", "network.hidden=20"),
)
ALONE = (*SHORT, "target=near", "method=scratch")
TRANSFER = (*SHORT, "source=near", "target=met", "method=finetune", "layers=3")
KILLED = -signal.SIGKILL
# Python's audit hooks announce these changes of a folder; the second ones need room on the disk.
CHANGES = {"open", "os.mkdir", "os.rename", "os.remove", "os.rmdir", "os.link", "os.chmod", "os.truncate"}
NEEDS_ROOM = {"open", "os.mkdir", "os.link"}
WRITES = os.O_WRONLY | os.O_RDWR


def before_changes(act: Callable[[int, str, str], None]) -> None:
    """Call `act` with number (from 0), event and path of each change of this process in its folder."""
    folder, numbers = f"{Path.cwd()}/", itertools.count()

    def hook(event: str, arguments: tuple[object, ...]) -> None:
        if event not in CHANGES or not isinstance(arguments[0], str | os.PathLike):
            return
        if event == "open" and not (isinstance(arguments[2], int) and arguments[2] & WRITES):
            return
        path = str(Path.cwd() / os.fspath(arguments[0]))
        if path.startswith(folder):
            act(next(numbers), event, path)

    sys.addaudithook(hook)


def die_at(step: int) -> Callable[[], None]:
    """Kill the child before its step of that number."""

    def act(number: int, event: str, path: str) -> None:
        if number == step:
            os.kill(os.getpid(), signal.SIGKILL)

    return lambda: before_changes(act)


def full_at(step: int) -> Callable[[], None]:
    """Let no file or folder be made any more from a step on, as if the disk were full."""

    def act(number: int, event: str, path: str) -> None:
        if number >= step and event in NEEDS_ROOM:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), path)

    return lambda: before_changes(act)


def new_folder(place: Path) -> Path:
    """Make a folder with the two cases, to run a command in."""
    cases = place / "conf/case"
    cases.mkdir(parents=True)
    for name, text in CASES.items():
        (cases / f"{name}.yaml").write_text(text)
    return place


@cache
def undisturbed(words: tuple[str, ...]) -> Path:
    """Return the folder of a command without a fault."""
    folder = new_folder(Path(mkdtemp(prefix="faults-")))
    ended = run(*words, folder=folder)
    assert ended.code == 0, ended
    return folder


def finish(words: tuple[str, ...], folder: Path) -> None:
    """Run a disturbed command again, and check that it leaves the same bytes as without a fault."""
    ended = run(*words, folder=folder)
    assert ended.code == 0 and "Traceback" not in ended.err, ended
    assert contents(folder) == contents(undisturbed(words))


def test_a_run_killed_between_two_steps_resumes(tmp_path: Path) -> None:
    folder = new_folder(tmp_path / "run")
    for step in (2, 16):
        assert run(*ALONE, folder=folder, before=die_at(step)).code == KILLED
    finish(ALONE, folder)


@pytest.mark.long
@pytest.mark.parametrize("seed", range(4))
def test_a_transfer_killed_before_any_steps_resumes(seed: int, tmp_path: Path) -> None:
    rng, folder = random.Random(seed), new_folder(tmp_path / "run")
    for _ in range(rng.randint(1, 12)):
        if run(*TRANSFER, folder=folder, before=die_at(rng.randrange(150))).code == 0:
            break
    finish(TRANSFER, folder)


def small_files() -> None:
    """Let no file grow past what the output of a command needs."""
    resource.setrlimit(resource.RLIMIT_FSIZE, (4096, 4096))


@pytest.mark.parametrize("fault", [full_at(0), full_at(9), small_files])
def test_a_full_disk_is_reported_and_loses_nothing(fault: Callable[[], None], tmp_path: Path) -> None:
    # Loops are compiled before, whose cache is on the same disk.
    undisturbed(ALONE)
    folder = new_folder(tmp_path / "run")
    ended = run(*ALONE, folder=folder, before=fault)
    assert ended.code == 0 or ended.is_refusal, ended
    left = [str(path.relative_to(folder)) for path in folder.rglob("*") if path.is_file()]
    assert not [name for name in left if DRAFT.search(name)]
    finish(ALONE, folder)


def test_two_equal_commands_train_once(tmp_path: Path) -> None:
    folder = new_folder(tmp_path / "run")
    ended = [child.finish() for child in [Running(ALONE, folder), Running(ALONE, folder)]]
    assert all(one.code == 0 and "Traceback" not in one.err for one in ended), ended
    assert "".join(one.out for one in ended).count("is already finished") == 1
    assert contents(folder) == contents(undisturbed(ALONE))


def cut(data: bytes) -> bytes:
    return data[: len(data) // 2]


def flip(data: bytes) -> bytes:
    return data[:100] + bytes(byte ^ 0x10 for byte in data[100:120]) + data[120:]


def odd(data: bytes) -> bytes:
    return b'{"a": [[1e999, "\xc3\xa4\x1b[31m"]]}'


# The words of a command, and a file that it reads, which is damaged.
RESULTS = ("results", "outputs", "--stability")
EVALUATE = ("evaluate", "outputs/smoke/near/scratch/seed=0")
READS = [
    (RESULTS, "outputs/smoke/near/scratch/seed=0/result.json"),
    (RESULTS, "outputs/smoke/near/scratch/seed=0/curve.csv"),
    (EVALUATE, "outputs/smoke/near/scratch/seed=0/config.yaml"),
    (EVALUATE, "outputs/smoke/near/scratch/seed=0/policy.safetensors"),
    (TRANSFER, "outputs/smoke/case_base/near/scratch/*/entry.json"),
    (TRANSFER, "outputs/smoke/case_base/near/scratch/*/policy.safetensors"),
]


@pytest.mark.parametrize(("words", "pattern"), READS, ids=lambda value: str(value)[-30:])
def test_a_command_names_a_damaged_file(words: tuple[str, ...], pattern: str, tmp_path: Path) -> None:
    # A transfer trains all the same where it can.
    for damage in (cut,) if words == TRANSFER else (cut, flip, odd):
        folder = shutil.copytree(undisturbed(ALONE), tmp_path / damage.__name__)
        (path,) = folder.glob(pattern)
        path.write_bytes(damage(path.read_bytes()))
        ended = run(*words, folder=folder)
        assert ended.code == 0 or ended.is_refusal, (damage.__name__, ended)
        assert "Traceback" not in ended.out + ended.err and "\x1b[31m" not in ended.out + ended.err
