"""A network takes over the choices of an expert that says what each action would earn."""

from typing import Any

import torch
from tensordict import TensorDict
from torch import Tensor

from ship_trl.learn.aggrevate import VALUE, Aggrevate, build
from ship_trl.learn.train import Training, train
from tests.learn.test_pupil import LEARN, PLACES, teacher
from tests.learn.worlds import Corridor, corridor_setup, schedule

OPTIONS = {"own_fraction": 0.2, "temperature": 0.3, "huber_weight": 0.3, "worst": 60.0}


def make(seed: int = 0, **changes: Any) -> Aggrevate:
    return build(
        corridor_setup(
            seed, schedule(**LEARN), teacher=changes.pop("teacher", teacher), options=OPTIONS | changes
        )
    )


def agreement(learner: Aggrevate) -> float:
    chosen = learner.greedy(TensorDict({"state": PLACES}, [len(PLACES)]))["action"]
    return float((chosen == teacher(PLACES).argmax(-1)).float().mean())


def test_it_takes_over_the_choices_of_the_expert() -> None:
    learner = make()
    before = agreement(learner)
    for _ in train(Corridor(3), Corridor(1), learner, schedule(**LEARN)):
        pass
    assert agreement(learner) > 0.9 > before


def test_the_expert_acts_at_first_and_is_asked_once_for_each_state() -> None:
    asked: list[Tensor] = []

    def expert(state: Tensor) -> Tensor:
        asked.append(state)
        return teacher(state)

    learner, env = make(teacher=expert), Corridor(50)
    step = env.reset()
    first = learner.act(step.clone(), 0)
    late = learner.act(step.clone(), 30)
    best = teacher(step["state"]).argmax(-1)
    assert torch.equal(first["action"], best) and not torch.equal(late["action"], best)
    assert torch.equal(first[VALUE], teacher(step["state"])) and len(asked) == 2
    stepped, _ = env.step_and_maybe_reset(first)
    learner.observe(stepped)
    batch = learner.replay.sample(20)
    assert torch.equal(batch[VALUE], teacher(batch["state"]))
    learner.loss(batch)
    assert len(asked) == 2


def test_how_bad_an_action_is_counts_down_to_a_bound() -> None:
    learner = make()
    learner.settings.worst = 1.0 / learner.learn.reward_scale
    state = PLACES[:4]
    value = torch.tensor([[0.0, -0.5, -9.0]]).repeat(4, 1)
    same = torch.tensor([[0.0, -0.5, -1.0]]).repeat(4, 1)
    losses = [learner.loss(TensorDict({"state": state, VALUE: each}, [4])) for each in (value, same)]
    assert torch.equal(*losses)


def test_it_goes_on_from_a_checkpoint_with_the_same_bits() -> None:
    def run(stop: int | None) -> dict[str, Tensor]:
        training = Training(Corridor(3), Corridor(1), make(), schedule(**LEARN))
        for step in range(120):
            list(training.advance())
            if step == stop:
                state = {key: value.clone() for key, value in training.state_dict().items()}
                training = Training(Corridor(3), Corridor(1), make(seed=7), schedule(**LEARN))
                training.load_state_dict(state)
        return training.algorithm.network.state_dict()

    whole, resumed = run(None), run(60)
    assert all(torch.equal(whole[key], resumed[key]) for key in whole)
