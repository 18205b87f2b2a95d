"""Of two checkpoints the newest intact one is read."""

import dataclasses
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
import torch
from torch import Tensor

from ship_trl.run.checkpoint import NAMES, Checkpoints, read_newest, write
from ship_trl.run.header import About, read_header

ABOUT = About("0123456789ab", "float32 dense cpu", 5, 100, 150, 12.5, [])


def tensors(step: int) -> dict[str, Tensor]:
    return {
        "weights": torch.full((40, 50), float(step)),
        "halves": torch.full((3,), step / 3, dtype=torch.bfloat16),
        "flags": torch.tensor([True, False]),
        "one": torch.tensor(step),
        "none": torch.empty(0),
    }


def at(step: int) -> About:
    return dataclasses.replace(ABOUT, episode=step // 30, steps=step)


def written(folder: Path, *steps: int) -> tuple[Path, ...]:
    for step, name in zip(steps, NAMES, strict=True):
        write(folder / name, tensors(step), at(step))
    return tuple(folder / name for name in NAMES)


def newest(folder: Path) -> About:
    found, _ = read_newest([folder / name for name in NAMES], ABOUT.config_hash)
    assert found is not None
    return found[1]


def test_the_newest_is_read(tmp_path: Path) -> None:
    paths = written(tmp_path, 90, 60)
    found, damaged = read_newest(paths, ABOUT.config_hash)
    assert found is not None and found[:2] == (paths[0], at(90)) and damaged == {}
    for name, value in tensors(90).items():
        assert torch.equal(found[2][name], value)
    paths[0].unlink()
    assert newest(tmp_path) == at(60)


def cut(path: Path) -> None:
    path.write_bytes(path.read_bytes()[:-100])


def flip(path: Path) -> None:
    """Flip one bit of the weights; the header stays intact."""
    data = bytearray(path.read_bytes())
    data[-2000] ^= 8
    path.write_bytes(data)


def lie(path: Path) -> None:
    """Write another episode into the header."""
    data = path.read_bytes()
    changed = data.replace(b'\\"episode\\": 2', b'\\"episode\\": 9')
    assert changed != data
    path.write_bytes(changed)


@pytest.mark.parametrize("damage", [cut, flip, lie])
def test_a_damaged_checkpoint_is_named_and_the_previous_is_read(
    damage: Callable[[Path], None], tmp_path: Path
) -> None:
    paths = written(tmp_path, 30, 60)
    damage(paths[1])
    assert newest(tmp_path) == at(30)
    ((named, reason),) = read_newest(paths, ABOUT.config_hash)[1].items()
    assert named == paths[1] and "\n" not in reason


def test_a_checkpoint_of_other_settings_is_not_read(tmp_path: Path) -> None:
    paths = written(tmp_path, 30, 60)
    assert read_newest(paths, "another hash") == (None, {})
    assert read_header(paths[0]) == at(30) and read_header(tmp_path / "none") is None


def test_only_the_end_of_the_run_to_extend_is_read(tmp_path: Path) -> None:
    paths = written(tmp_path, 3000, 60)
    for extends, found in ((ABOUT.config_hash, paths[0]), ("another", None)):
        read = read_newest(paths, "an extension", extends)[0]
        assert (read and read[0]) == found
    assert read_newest(paths[1:], "an extension", ABOUT.config_hash) == (None, {})


def test_a_checkpoint_is_due_by_episodes_and_time(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    clock, training = SimpleNamespace(now=100.0), SimpleNamespace(episode=20)
    monkeypatch.setattr("ship_trl.run.checkpoint.time.monotonic", lambda: clock.now)
    interval, learn = SimpleNamespace(every=0.1, seconds=60), SimpleNamespace(episodes=100)
    run: Any = SimpleNamespace(folder=tmp_path, config=SimpleNamespace(checkpoint=interval, learn=learn))
    parts: Any = SimpleNamespace(training=training)
    checkpoints = Checkpoints(run, parts, 0.0)
    for clock.now, training.episode, is_due in ((159.0, 50, False), (160.0, 29, False), (160.0, 30, True)):
        assert checkpoints.is_due is is_due
    # Without an interval, after each episode.
    interval.every = interval.seconds = 0
    training.episode = 20
    assert not checkpoints.is_due
    training.episode = 21
    assert checkpoints.is_due
