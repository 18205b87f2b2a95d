"""A pupil takes over its teacher's choices, and continues from a checkpoint with the same bits."""

from typing import Any

import pytest
import torch
from tensordict import TensorDict
from torch import Tensor

from ship_trl.config.types import BackendName
from ship_trl.learn.hooks import LearningHooks
from ship_trl.learn.pupil import Pupil, build, distillation_loss
from ship_trl.learn.train import Finished, Training, train
from tests.learn.worlds import Corridor, Freezing, corridor_setup, schedule

OPTIONS = {"teacher": "file", "own_fraction": 0.5, "temperature": 0.3, "huber_weight": 0.3, "candidates": 6}
LEARN = {"episodes": 40, "batch_size": 16, "epsilon_start": 0.5, "epsilon_end": 0.5, "lr_end": 1e-4}
# All places of the corridor where an action is taken.
PLACES = torch.arange(-3.0, 4.0)[:, None] * torch.tensor([1.0, 0.0])


def teacher(state: Tensor) -> Tensor:
    """Return Q-values whose best action changes with the place: 1, then 0, then 2."""
    x = state[..., :1]
    return torch.cat((0 * x, -0.5 - x, x - 0.5), -1)


def flip(state: Tensor) -> Tensor:
    """Exchange both ends of the corridor."""
    return state * torch.tensor([-1.0, 1.0])


def make(seed: int = 0, method: LearningHooks | None = None, mirror: Any = None, **changes: Any) -> Pupil:
    options = changes.pop("options", OPTIONS)
    given = {"method": method or LearningHooks(), "options": options, "teacher": teacher, "mirror": mirror}
    return build(corridor_setup(seed, schedule(**LEARN | changes), **given))


def agreement(pupil: Pupil) -> float:
    """Return the share of the places where pupil and teacher choose alike."""
    chosen = pupil.greedy(TensorDict({"state": PLACES}, [len(PLACES)]))["action"]
    return float((chosen == teacher(PLACES).argmax(-1)).float().mean())


def taught(**changes: Any) -> Pupil:
    pupil = make(**changes)
    for _ in train(Corridor(3), Corridor(1), pupil, schedule(**LEARN)):
        pass
    return pupil


@pytest.mark.parametrize("backend", [BackendName.dense, BackendName.incremental])
def test_it_takes_over_the_choices_of_its_teacher(backend: BackendName) -> None:
    before, after = make(backend=backend), taught(backend=backend)
    assert agreement(after) > 0.9 > agreement(before)
    assert after.backend == backend.name


def test_the_loss_is_the_divergence_and_hubers_loss() -> None:
    q, wanted = torch.tensor([[0.5, 3.0], [1.0, 1.0]]), torch.tensor([[0.0, 1.0], [1.0, 2.0]])
    p, log = (wanted / 0.5).softmax(-1), (q / 0.5).log_softmax(-1)
    divergence = (p * (p.log() - log)).sum(-1).mean()
    # Errors of 0.5, 2, 0 and 1: squares up to 1, linear above.
    huber = (0.125 + 1.5 + 0.0 + 0.5) / 4
    torch.testing.assert_close(distillation_loss(q, wanted, 0.5, 0.0), divergence)
    torch.testing.assert_close(distillation_loss(q, wanted, 0.5, 0.3), divergence + 0.3 * huber)
    assert float(distillation_loss(wanted, wanted, 0.5, 0.3)) == pytest.approx(0, abs=1e-6)


def holding(states: Tensor, **changes: Any) -> Pupil:
    """Return a pupil whose replay holds states [N, S]."""
    pupil, count = make(**changes), len(states)
    ends = {
        "done": torch.zeros(count, 1, dtype=torch.bool),
        "terminated": torch.zeros(count, 1, dtype=torch.bool),
    }
    following = TensorDict({"state": states, "reward": torch.zeros(count, 1), **ends}, [count])
    step = {"state": states, "action": torch.zeros(count, dtype=torch.int64), "next": following}
    pupil.replay.extend(TensorDict(step, [count]))
    return pupil


def test_half_of_a_batch_are_mirror_images() -> None:
    left = torch.tensor([[-3.0, 0.0]] * 8)
    pupil = holding(left, mirror=flip, batch_size=64)
    found = pupil.sample()
    assert (pupil.replay[:]["state"] == left).all()
    assert 16 < (found["state"][:, 0] == 3.0).sum() < 48
    torch.testing.assert_close(found["teacher_q"], teacher(found["state"]))
    assert (holding(left, batch_size=64).sample()["state"] == left[0]).all()


@pytest.mark.parametrize("candidates", [1, 8])
def test_states_are_learned_the_likelier_the_more_the_choice_matters(candidates: int) -> None:
    # The ranges of the teacher's Q-values are 0.5 and 2.5.
    states = torch.tensor([[0.0, 0.0], [2.0, 0.0]])
    options = OPTIONS | {"candidates": candidates}
    found = holding(states, options=options, batch_size=600).sample()["state"][:, 0]
    share = float((found == 2.0).float().mean())
    # All of 600 states are learned, or 600 of 4,800, half of which are about five times as likely.
    assert share == pytest.approx(0.5 if candidates == 1 else 5 / 6, abs=0.06)


def test_a_checkpoint_goes_on_with_the_same_bits() -> None:
    learn, method = schedule(**LEARN | {"episodes": 14}), Freezing(2, until=0.5)
    whole = Training(Corridor(3), Corridor(1), make(method=method, episodes=14), learn)
    # Layers thaw later.
    while whole.episode < 5:
        list(whole.advance())
    state = {key: value.clone() for key, value in whole.state_dict().items()}
    again = Training(Corridor(3), Corridor(1), make(seed=5, method=method, episodes=14), learn)
    again.load_state_dict(state)
    while not whole.is_finished:
        found = [[e for e in one.advance() if isinstance(e, Finished)] for one in (whole, again)]
        assert found[0] == found[1]
    first, second = whole.state_dict(), again.state_dict()
    assert first.keys() == second.keys()
    assert all(torch.equal(first[key], second[key]) for key in first)
