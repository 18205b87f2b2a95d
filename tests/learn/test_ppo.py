"""Proximal policy optimisation: heads, advantages, loss, freezing, checkpoints; it learns a corridor."""

import math
from typing import Any

import pytest
import torch
from tensordict import TensorDict, TensorDictBase

from ship_trl.learn.algorithm import DivergedError
from ship_trl.learn.hooks import LearningHooks
from ship_trl.learn.ppo import PPO, build, state_value
from ship_trl.learn.train import Evaluated, Finished, Training, train
from tests.learn.worlds import Corridor, Freezing, corridor_setup, draw, schedule

OPTIONS = {
    "rollout_steps": 16,
    "epochs": 4,
    "minibatch_size": 32,
    "clip_epsilon": 0.2,
    "gae_lambda": 0.95,
    "entropy_coeff": 0.01,
    "critic_coeff": 0.5,
    "max_grad_norm": 0.5,
    "imitation_coeff": 0.0,
    "imitation_start": 0.0,
}


def make(
    seed: int = 0, method: LearningHooks | None = None, learn: dict[str, Any] | None = None, **changes: float
) -> PPO:
    values = schedule(**{"episodes": 120, "num_envs": 4} | (learn or {}))
    return build(corridor_setup(seed, values, method=method or LearningHooks(), options=OPTIONS | changes))


def walk(
    learner: PPO, steps: int, limit: int = 12, num_envs: int = 4, episode: int = 0
) -> list[TensorDictBase]:
    """Let the algorithm act and observe, without updates, and return the steps."""
    env, seen = Corridor(num_envs, limit), []
    current = env.reset()
    for _ in range(steps):
        stepped, current = env.step_and_maybe_reset(learner.act(current, episode))
        learner.observe(stepped)
        seen.append(stepped.clone())
    return seen


def observed(learner: PPO, steps: int = 16, limit: int = 12) -> TensorDictBase:
    """Return the steps of a walk with advantages."""
    walk(learner, steps, limit)
    judged: TensorDictBase = learner.judge(TensorDict.stack(learner._rollout))
    return judged


def test_it_learns() -> None:
    learn = schedule(episodes=120, num_envs=4, lr=1e-3)
    learner = make(learn={"lr": 1e-3})
    events = list(train(Corridor(4), Corridor(1), learner, learn))
    found = [e.episode_return for e in events if isinstance(e, Evaluated)]
    assert max(found[1:]) == 96.0 > found[0]
    assert all(math.isnan(e.epsilon) for e in events if isinstance(e, Finished))


def test_outputs_hold_both_heads_and_each_loss_moves_its_own() -> None:
    network = make().online_network
    output = network(draw(torch.rand(5, 2) * 8 - 4))
    shared = torch.relu(network.shared(network.backend.features(network, draw(torch.zeros(5, 2)))))
    both = network.dueling(network.backend.features(network, draw(torch.zeros(5, 2))))
    torch.testing.assert_close(both.softmax(-1), network.advantage(shared).softmax(-1))
    torch.testing.assert_close(state_value(both), network.value(shared))
    heads = [network.value.weight, network.advantage.weight]
    for loss, moved in ((output.log_softmax(-1)[:, 0].sum(), 1), (state_value(output).sum(), 0)):
        sizes = [float(g.norm()) for g in torch.autograd.grad(loss, heads, retain_graph=True)]
        assert sizes[moved] > 1e4 * sizes[1 - moved]


@pytest.mark.parametrize("limit", [3, 12])
def test_advantages_bootstrap_at_truncations_and_stop_at_every_end(limit: int) -> None:
    learner = make(learn={"reward_scale": 0.1})
    steps = walk(learner, 16, limit)
    got = learner.judge(TensorDict.stack(learner._rollout))
    assert any(step["next", "truncated" if limit == 3 else "terminated"].any() for step in steps)
    value = [state_value(learner.online_network(draw(step["state"]))) for step in steps]
    after = [state_value(learner.online_network(draw(step["next", "state"]))) for step in steps]
    advantage, found = torch.zeros(4, 1), []
    for step, now, then in reversed(list(zip(steps, value, after, strict=True))):
        following = step["next"]
        error = following["reward"] * 0.1 + 0.9 * then * ~following["terminated"] - now
        advantage = error + 0.9 * OPTIONS["gae_lambda"] * advantage * ~following["done"]
        found.append(advantage)
    wanted = torch.stack(found[::-1]).detach()
    torch.testing.assert_close(
        got["value_target"], wanted + torch.stack(value).detach(), rtol=1e-4, atol=1e-5
    )
    scaled = (wanted - wanted.mean()) / wanted.std()
    torch.testing.assert_close(got["advantage"], scaled, rtol=1e-3, atol=1e-4)


def test_the_loss_is_the_clipped_objective_with_critic_and_entropy() -> None:
    learner = make(learn={"lr": 0.02}, max_grad_norm=100.0)
    batch = observed(learner).flatten()
    for _ in range(3):  # after the first update probabilities differ
        with torch.no_grad():
            output = learner.online_network(draw(batch["state"]))
        log = output.log_softmax(-1)
        ratio = (log.gather(-1, batch["action"][:, None]).squeeze(-1) - batch["action_log_prob"]).exp()
        advantage = batch["advantage"].squeeze(-1)
        gain = torch.minimum(ratio * advantage, ratio.clamp(0.8, 1.2) * advantage).mean()
        critic = (state_value(output) - batch["value_target"]).square().mean()
        entropy = -(log.exp() * log).sum(-1).mean()
        wanted = -gain + 0.5 * critic - 0.01 * entropy
        torch.testing.assert_close(learner.learn_from(batch.clone()), wanted, rtol=1e-4, atol=1e-5)
    assert (ratio - 1).abs().max() > 0.2


@pytest.mark.parametrize(("episode", "imitates"), [(59, False), (60, True)])
def test_the_best_episode_is_imitated_from_a_share_of_the_episodes_on(episode: int, imitates: bool) -> None:
    losses = []
    for coeff in (0.0, 2.0):
        learner = make(imitation_coeff=coeff, imitation_start=0.5)
        seen = walk(learner, 16, limit=4, episode=episode)
        steps = learner.judge(TensorDict.stack(learner._rollout)).flatten()
        losses.append(float(learner.learn_from(steps)))
    # Episodes of four steps; of equally good ones the first is kept.
    taken: TensorDict = torch.stack(seen).unflatten(0, (4, 4))
    number = int(taken["next", "reward"].sum(1).flatten().argmax())
    best = taken[number // 4, :, number % 4]
    with torch.no_grad():
        output = make().online_network(draw(best["state"]))
    likelihood = output.log_softmax(-1).gather(-1, best["action"][:, None]).mean()
    assert losses[1] == pytest.approx(losses[0] - 2.0 * float(likelihood) * imitates, rel=1e-4)


@pytest.mark.parametrize("until", [2.0, 0.05])
@pytest.mark.parametrize(("cut", "imitation"), [(16, 0.0), (23, 1.0)])
def test_a_checkpoint_goes_on_with_the_same_bits(cut: int, imitation: float, until: float) -> None:
    learn = schedule(episodes=120, num_envs=4)
    whole = Training(
        Corridor(4), Corridor(1), make(method=Freezing(2, until), imitation_coeff=imitation), learn
    )
    for _ in range(cut):
        list(whole.advance())
    state = {key: value.clone() for key, value in whole.state_dict().items()}
    again = Training(
        Corridor(4), Corridor(1), make(seed=5, method=Freezing(2, until), imitation_coeff=imitation), learn
    )
    again.load_state_dict(state)
    for _ in range(20):
        found = [[e for e in one.advance() if isinstance(e, Finished)] for one in (whole, again)]
        assert repr(found[0]) == repr(found[1])  # an epsilon of NaN is not equal to itself
    one, other = (training.state_dict() for training in (whole, again))
    assert one.keys() == other.keys()
    assert all(torch.equal(one[key], other[key]) for key in one)


def test_an_output_that_is_not_finite_stops_the_training() -> None:
    learner = make()
    walk(learner, 3)
    with torch.no_grad():
        learner.online_network.advantage.weight.fill_(math.nan)
    with pytest.raises(DivergedError, match="an output of the network is not finite"):
        walk(learner, 1)
