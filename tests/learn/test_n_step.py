"""Targets of several steps, by hand and in a training."""

import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from tensordict import TensorDict
from torch import Generator
from torchrl.modules import QValueActor
from torchrl.objectives import DQNLoss, SoftUpdate

from ship_trl.learn.double_dqn import DoubleDQN
from ship_trl.learn.n_step import build
from ship_trl.learn.q_learning import STEPS
from ship_trl.learn.replay import StateReplay
from ship_trl.learn.rollout import rollout
from ship_trl.learn.train import Evaluated, train
from tests.learn.worlds import Corridor, corridor_setup, schedule

CPU, GAMMA = torch.device("cpu"), 0.9


def make(steps: int, seed: int = 0, **changes: object) -> DoubleDQN:
    return build(corridor_setup(seed, schedule(**changes), options={"steps": steps}))


def filled(memory: StateReplay, steps: int, num_envs: int, seed: int) -> list[TensorDict]:
    """Store random steps of a corridor, and return them."""
    env, generator = Corridor(num_envs), Generator().manual_seed(seed)
    current, seen = env.reset(), []
    for _ in range(steps):
        action = torch.randint(3, (num_envs,), generator=generator)
        stepped, current = env.step_and_maybe_reset(current.set("action", action))
        memory.extend(stepped)
        seen.append(stepped.clone())
    return seen


@settings(max_examples=30)
@given(
    n=st.integers(1, 5),
    num_envs=st.integers(1, 3),
    steps=st.integers(1, 40),
    capacity=st.integers(20, 60),
    seed=st.integers(0, 99),
)
def test_targets_are_those_of_the_steps_that_follow(
    n: int, num_envs: int, steps: int, capacity: int, seed: int
) -> None:
    memory = StateReplay(capacity, 1.0, Generator().manual_seed(0), CPU, n=n, gamma=GAMMA)
    seen = filled(memory, steps, num_envs, seed)
    kept = min(capacity, steps * num_envs)
    got = memory[:]
    wanted = {}
    for time in range(steps):
        for row in range(num_envs):
            reward, last = 0.0, time
            for k in range(min(n, steps - time)):
                last = time + k
                reward += GAMMA**k * float(seen[last]["next", "reward"][row])
                if bool(seen[last]["next", "done"][row]):
                    break
            wanted[time * num_envs + row] = (reward, last, row, last - time + 1)
    newest = sorted(wanted)[-kept:]
    assert len(got) == kept
    for place in newest:
        reward, last, row, count = wanted[place]
        one = got[place % capacity]
        assert float(one["next", "reward"]) == pytest.approx(reward, abs=1e-4)
        assert torch.equal(one["next", "state"], seen[last]["next", "state"][row])
        assert bool(one["next", "terminated"]) == bool(seen[last]["next", "terminated"][row])
        assert n == 1 or int(one[STEPS]) == count
        assert torch.equal(one["state"], seen[place // num_envs]["state"][row])


def test_torchrls_loss_gives_the_same() -> None:
    learner = make(3)
    filled(learner.replay, 40, 3, 2)
    actor = QValueActor(learner.online_network, in_keys=["pixels"], action_space="categorical")
    other = DQNLoss(actor, loss_function="l2", double_dqn=True, action_space="categorical")
    other.make_value_estimator(gamma=learner.learn.gamma)
    SoftUpdate(other, tau=0.1)
    batch = learner.replay.sample(16)
    assert float(batch[STEPS].max()) == 3
    torch.testing.assert_close(learner.loss(batch), other(batch)["loss"], rtol=1e-5, atol=1e-6)


def test_it_learns_and_a_checkpoint_goes_on_with_the_same_bits() -> None:
    learner = make(3, episodes=120, lr=1e-3)
    learn = schedule(episodes=120, lr=1e-3)
    events = list(train(Corridor(3), Corridor(1), learner, learn))
    assert max(e.episode_return for e in events[1:] if isinstance(e, Evaluated)) == 96.0
    assert rollout(Corridor(1), learner.greedy)[0].length <= 12
    again = make(3, seed=1, episodes=120, lr=1e-3)
    again.load_state_dict({key: value.clone() for key, value in learner.state_dict().items()})
    losses = [one.learn_from(one.replay.sample(8)) for one in (learner, again)]
    assert torch.equal(*losses)
