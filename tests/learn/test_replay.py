"""Replay of states: samples are whole transitions, drawn from its own generator."""

from pathlib import Path
from typing import Any

import pytest
import torch
from tensordict import TensorDict
from torch import Generator
from torchrl.data import LazyTensorStorage, ReplayBuffer

from ship_trl.learn.replay import DrawStates, StateReplay, TransitionStorage
from tests.learn.worlds import draw


def steps(first: int, count: int) -> TensorDict:
    """Steps numbered by their state, so that a sample can be traced."""
    number = torch.arange(first, first + count).float()
    flags = torch.zeros(count, 1, dtype=torch.bool)
    return TensorDict(
        {
            "state": torch.stack((number, number), -1),
            "action": (number % 7).long(),
            "unwanted": torch.zeros(count, 1000),
            "next": {
                "state": torch.stack((number + 1, number + 1), -1),
                "reward": number[:, None] * 100,
                "done": flags,
                "terminated": number[:, None] % 3 == 0,
                "truncated": flags.clone(),
            },
        },
        batch_size=[count],
    )


def replay(capacity: int = 100, seed: int = 0, **options: Any) -> StateReplay:
    return StateReplay(capacity, 0.01, Generator().manual_seed(seed), torch.device("cpu"), **options)


def test_samples_are_whole_transitions() -> None:
    memory = replay()
    for first in range(0, 40, 4):
        memory.extend(steps(first, 4))
    assert len(memory) == 40
    batch = memory.sample(64)
    number = batch["state"][:, 0]
    assert torch.equal(batch["action"], (number % 7).long())
    assert torch.equal(batch["next", "state"][:, 0], number + 1)
    torch.testing.assert_close(batch["next", "reward"][:, 0], number)
    assert torch.equal(batch["next", "terminated"][:, 0], number % 3 == 0)


def test_pixels_are_drawn_beside_the_states_of_a_batch() -> None:
    memory = replay(transform=DrawStates(draw))
    memory.extend(steps(0, 40))
    batch = memory.sample(16)
    assert torch.equal(batch["pixels"], draw(batch["state"]))
    assert torch.equal(batch["next", "pixels"], draw(batch["next", "state"]))
    assert "pixels" not in memory.storage[0]


def test_the_storage_equals_torchrls() -> None:
    given = steps(0, 40).exclude("unwanted", ("next", "truncated"))
    found = []
    for storage in (TransitionStorage(30, torch.device("cpu")), LazyTensorStorage(30)):
        buffer = ReplayBuffer(
            storage=storage,
            collate_fn=lambda batch: batch,
            generator=Generator().manual_seed(3),
            batch_size=16,
        )
        buffer.extend(given[:25])
        part = buffer.sample()
        buffer.add(given[25])
        buffer.extend(given[26:])  # overwrites the first ten
        found.append((part, buffer.sample(), len(buffer)))
    for mine, other in zip(*found, strict=True):
        assert mine == other if isinstance(mine, int) else bool((mine == other).all())
    assert found[0][2] == 30


def filled(capacity: int, count: int) -> StateReplay:
    memory = replay(capacity)
    for first in range(0, count, 4):
        memory.extend(steps(first, 4))
    return memory


@pytest.mark.parametrize(("capacity", "count"), [(8, 24), (20, 24), (8, 8)])
def test_the_state_of_another_capacity_is_refused(capacity: int, count: int) -> None:
    other, memory = filled(12, 24), filled(capacity, count)
    before = memory.sample(50)["action"]
    with pytest.raises(ValueError, match=r"of a replay has 12 rows; allowed: \d+, of the same"):
        memory.load_state_dict(other.state_dict())
    memory.generator.manual_seed(0)
    assert len(memory) == capacity and torch.equal(memory.sample(50)["action"], before)


def test_a_replay_that_is_not_full_fits_a_larger_one() -> None:
    memory = replay(20)
    memory.load_state_dict(filled(12, 8).state_dict())
    for first in range(8, 24, 4):
        memory.extend(steps(first, 4))
    assert set(memory.sample(500)["state"][:, 0].int().tolist()) == set(range(4, 24))


def test_what_would_lose_the_transitions_is_refused(tmp_path: Path) -> None:
    with pytest.raises(NotImplementedError, match=r"state_dict\(\)"):
        filled(12, 8).dumps(tmp_path / "replay")
