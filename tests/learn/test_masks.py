"""Under a mask no algorithm takes a forbidden action, and none bootstraps from one."""

from typing import Any

import pytest
import torch
from tensordict import TensorDict, TensorDictBase
from torch import Generator, Tensor

from ship_trl.learn import double_dqn, n_step, ppo, pupil
from ship_trl.learn.algorithm import Algorithm
from ship_trl.learn.double_dqn import DoubleDQN
from ship_trl.learn.masks import ACTION_MASK
from ship_trl.learn.network import DuelingNetwork
from ship_trl.learn.rollout import EpsilonGreedy, greedy_policy, jumpstart, rollout
from ship_trl.learn.train import Training
from tests.learn.test_ppo import OPTIONS as ROLLOUTS
from tests.learn.test_pupil import OPTIONS as TAUGHT
from tests.learn.test_pupil import teacher
from tests.learn.worlds import Corridor, Freezing, corridor_setup, draw, schedule


def mask(state: Tensor) -> Tensor:
    """Forbid an action that changes with place and time."""
    return torch.arange(3) != state.sum(-1, keepdim=True).remainder(3)


BUILT = {
    "double_dqn": (double_dqn.build, {}),
    "n_step": (n_step.build, {"steps": 3}),
    "ppo": (ppo.build, ROLLOUTS | {"rollout_steps": 6, "minibatch_size": 6, "imitation_coeff": 1.0}),
    "pupil": (pupil.build, TAUGHT),
}


def make(name: str, seed: int = 0, frozen: int = 0, **changes: Any) -> Algorithm:
    build: Any
    build, options = BUILT[name]
    parts = {"options": options, "teacher": teacher, "mask": mask, "method": Freezing(frozen)}
    learner: Algorithm = build(corridor_setup(seed, schedule(**changes), **parts))
    return learner


def training(name: str, seed: int = 0, **changes: Any) -> Training:
    learner = make(name, seed, episodes=14, **changes)
    return Training(Corridor(3, encoders=learner.encoders), Corridor(1), learner, schedule(episodes=14))


def taken(learner: Algorithm, episodes: int) -> tuple[Tensor, Tensor]:
    """Return states and actions of a training."""
    seen: list[TensorDict] = []

    class Noting(Corridor):
        def _step(self, tensordict: TensorDictBase) -> TensorDict:
            seen.append(TensorDict({key: tensordict[key].clone() for key in ("state", "action")}, [3]))
            return super()._step(tensordict)

    env = Noting(3, encoders=learner.encoders)
    run = Training(env, Corridor(1), learner, schedule(episodes=episodes))
    while not run.is_finished:
        list(run.advance())
    steps: Any = torch.cat(seen)
    return steps["state"], steps["action"]


@pytest.mark.parametrize("name", BUILT)
def test_no_forbidden_action_is_taken(name: str) -> None:
    learner = make(name, episodes=20, epsilon_end=0.2)
    state, action = taken(learner, 20)
    assert bool(mask(state).gather(-1, action[:, None]).all())
    # All others are.
    assert {(int(s.sum()) % 3, int(a)) for s, a in zip(state, action, strict=True)} == {
        (place, kind) for place in range(3) for kind in range(3) if place != kind
    }
    (episode,) = rollout(Corridor(1), learner.greedy)
    assert bool(mask(episode.states[:-1]).gather(-1, episode.actions[:, None]).all())
    assert episode.q_values is not None and bool(episode.q_values.isfinite().all())


@pytest.mark.parametrize("name", BUILT)
def test_it_goes_on_from_a_checkpoint_with_the_same_bits(name: str) -> None:
    whole = training(name)
    while whole.episode < 5:
        list(whole.advance())
    state = {key: value.clone() for key, value in whole.state_dict().items()}
    again = training(name, seed=5)
    again.load_state_dict(state)
    for one in (whole, again):
        while not one.is_finished:
            list(one.advance())
    first, second = whole.state_dict(), again.state_dict()
    assert first.keys() == second.keys() and all(torch.equal(first[key], second[key]) for key in first)


@pytest.mark.parametrize(("name", "frozen"), [("double_dqn", 0), ("n_step", 0), ("double_dqn", 3)])
def test_the_target_is_of_an_allowed_action(name: str, frozen: int) -> None:
    learner = make(name, frozen=frozen)
    assert isinstance(learner, DoubleDQN)
    taken(learner, 6)
    batch = learner.replay.sample(200)
    if not frozen:
        assert torch.equal(batch["next", ACTION_MASK], mask(batch["next", "state"]))
    with torch.no_grad():
        following = batch["next", learner.observed]
        q, now = learner.online_network(following).tolist(), learner.online_network(batch[learner.observed])
        rated, wanted = learner.target_network(following).tolist(), []
    for row in range(200):
        best = max((k for k in range(3) if batch["next", ACTION_MASK][row, k]), key=q[row].__getitem__)
        steps = int(batch["steps_to_next_obs"][row]) if name == "n_step" else 1
        value = 0.9**steps * rated[row][best] * (not batch["next", "terminated"][row])
        error = float(now[row, batch["action"][row]]) - float(batch["next", "reward"][row]) - value
        wanted.append(error**2)
    assert learner.loss(batch).item() == pytest.approx(sum(wanted) / 200, rel=1e-3)
    # It is not that of all actions.
    del batch["next", ACTION_MASK]
    assert learner.loss(batch).item() != pytest.approx(sum(wanted) / 200, rel=1e-2)


def test_random_actions_are_uniform_over_the_allowed_ones() -> None:
    policy = EpsilonGreedy(
        lambda state, _: state[:, 0].long(), "state", 3, Generator().manual_seed(0), ACTION_MASK
    )
    allowed = torch.tensor([True, False, True]).expand(3000, 3)
    step = TensorDict({"state": torch.zeros(3000, 2), ACTION_MASK: allowed}, [3000])
    counts = policy(step)["action"].bincount(minlength=3).tolist()
    assert counts[1] == 0 and min(counts[0], counts[2]) > 1400


def test_probabilities_of_forbidden_actions_are_zero() -> None:
    learner = make("ppo")
    assert isinstance(learner, ppo.PPO)
    state = torch.tensor([[0.0, 0.0], [1.0, 0.0], [2.0, 0.0]])
    output = learner.online_network(draw(state)).detach()
    step = TensorDict({"state": state, "action_value": output, ACTION_MASK: mask(state)}, [3])
    distribution = learner.loss.actor_network.get_dist(step)
    forbidden = torch.arange(3)
    assert distribution.log_prob(forbidden).tolist() == [-torch.inf] * 3
    assert distribution.probs.diagonal().tolist() == [0.0] * 3
    wanted = output.exp() * mask(state)
    torch.testing.assert_close(distribution.probs, wanted / wanted.sum(-1, keepdim=True))
    # What acted is what learns.
    judged = learner.judge(rolled_out(learner))
    assert bool(judged["action_log_prob"].isfinite().all())
    again = learner.loss.actor_network.get_dist(
        judged.set("action_value", learner.online_network(draw(judged["state"])))
    )
    torch.testing.assert_close(again.log_prob(judged["action"]), judged["action_log_prob"])


def rolled_out(learner: ppo.PPO) -> Any:
    env = Corridor(3, encoders=learner.encoders)
    current = env.reset()
    for _ in range(6):
        stepped, current = env.step_and_maybe_reset(learner.act(current, 0))
        learner.observe(stepped)
    return TensorDict.stack(learner._rollout)


def test_jumpstart_returns_are_of_masked_policies() -> None:
    network = DuelingNetwork(1, 3, Generator().manual_seed(1), corridor_setup(0, schedule()).network.config)
    found = jumpstart(
        Corridor(4, encoders={ACTION_MASK: mask}), draw, network, (), 6, Generator().manual_seed(2)
    )
    generator, wanted = Generator().manual_seed(2), []
    for _ in range(6):
        network.reset(generator)
        wanted.append(rollout(Corridor(1), greedy_policy(network, draw, mask))[0].episode_return)
    assert found == wanted
