"""Two checkpoints are written in turn, and the newest intact one is read."""

import dataclasses
from collections.abc import Callable
from pathlib import Path

import pytest
import torch
from torch import Tensor

from ship_trl.files.disk import remove
from ship_trl.run.checkpoint import About, Checkpoints, read_hashes
from tests.run.test_full_disk import largest_file

ABOUT = About("0123456789ab", "float32 dense cpu", 5, 100, 150, 12.5)


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


def written(run: Path, *steps: int) -> Checkpoints:
    checkpoints = Checkpoints(run)
    for step in steps:
        checkpoints.write(tensors(step), at(step))
    return checkpoints


def test_two_generations_are_kept_and_the_newest_is_read(tmp_path: Path) -> None:
    checkpoints = written(tmp_path, 30, 60, 90)
    assert sorted(path.name for path in checkpoints.folder.iterdir()) == ["1.safetensors", "2.safetensors"]
    found, _ = checkpoints.read(ABOUT.config_hash)
    assert found is not None and found[0] == at(90)
    # The third replaced the first.
    (checkpoints.folder / "1.safetensors").unlink()
    found, _ = checkpoints.read(ABOUT.config_hash)
    assert found is not None and found[0] == at(60)


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
    checkpoints = written(tmp_path, 30, 60)
    damage(checkpoints.folder / "2.safetensors")
    found, damaged = checkpoints.read(ABOUT.config_hash)
    assert found is not None and found[0] == at(30)
    assert set(damaged) == {checkpoints.folder / "2.safetensors"}
    assert not any("\n" in reason for reason in damaged.values())
    for path in damaged:
        remove(path)
    checkpoints.write(tensors(90), at(90))
    found, _ = checkpoints.read(ABOUT.config_hash)
    assert found is not None and found[0] == at(90)


def test_a_checkpoint_of_other_settings_is_not_read(tmp_path: Path) -> None:
    checkpoints = written(tmp_path, 30)
    assert checkpoints.read("another hash") == (None, {})
    assert read_hashes(tmp_path) == {ABOUT.config_hash}


def test_a_checkpoint_is_due_by_episodes_and_time(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    now = 100.0
    monkeypatch.setattr("ship_trl.run.checkpoint.time.monotonic", lambda: now)
    checkpoints = Checkpoints(tmp_path, every=10, seconds=60)
    now = 159.0
    assert not checkpoints.due(50)
    now = 160.0
    assert checkpoints.due(10) and not checkpoints.due(9)
    checkpoints.write(tensors(300), at(300))
    assert not checkpoints.due(20)
    now = 220.0
    assert checkpoints.due(20) and not checkpoints.due(19)


def test_a_full_disk_leaves_the_previous_checkpoint(tmp_path: Path) -> None:
    checkpoints = written(tmp_path, 30, 60)
    with pytest.raises(OSError, match="too large"), largest_file(1000):
        checkpoints.write(tensors(90), at(90))
    assert sorted(path.name for path in checkpoints.folder.iterdir()) == ["1.safetensors", "2.safetensors"]
    found, damaged = checkpoints.read(ABOUT.config_hash)
    assert found is not None and found[0] == at(60) and damaged == {}
