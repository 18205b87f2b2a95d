"""Policies of Q-networks, and episodes of any policy.

Steps are deterministic, so one episode of a greedy policy from a start is exact.
"""

from __future__ import annotations

import copy
from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass

import torch
from tensordict import NestedKey, TensorDictBase
from tensordict.nn import TensorDictModule, TensorDictModuleBase, TensorDictSequential
from torch import Generator, Tensor
from torchrl.envs import EnvBase
from torchrl.modules import QValueActor

from ship_trl.learn.masks import ACTION_MASK, Mask, mask_of, mask_values
from ship_trl.learn.network import Dense, Draw, DuelingNetwork

# Steps for which memory is taken at first.
STEPS = 64
# What an episode is made of. Pictures are left out: those of 4,000 episodes take 10 GB.
KEPT: tuple[NestedKey, ...] = (
    *("state", "action", "action_value"),
    *(("next", key) for key in ("state", "reward", "done", "goal", "collision", "dcpa")),
)
# Reads a tensordict with `state` and writes `action`, as every policy module of TorchRL does.
Policy = Callable[[TensorDictBase], TensorDictBase]


def greedy_policy(network: DuelingNetwork, draw: Draw, mask: Mask | None = None) -> TensorDictSequential:
    """Return the policy that takes the action with the highest Q-value, of those that a mask allows.

    It reads `state` [N, S] and writes the key that the network observes, `action_value` float32 [N, A] and
    `action` int64 [N]; also `chosen_action_value` [N, 1], or with a mask `action_mask`. `draw` maps states to
    the network's input.
    """
    keys: list[NestedKey] = [network.observes]
    observe = TensorDictModule(draw, in_keys=["state"], out_keys=keys)
    if mask is None:
        return TensorDictSequential(observe, QValueActor(network, in_keys=keys, action_space="categorical"))
    # A masked `QValueActor` would write masked Q-values, which pictures show.
    rated: list[NestedKey] = ["action_value", ACTION_MASK]
    return TensorDictSequential(
        observe,
        TensorDictModule(network, in_keys=keys, out_keys=rated[:1]),
        TensorDictModule(mask, in_keys=["state"], out_keys=rated[1:]),
        TensorDictModule(lambda *both: mask_values(*both).argmax(-1), in_keys=rated, out_keys=["action"]),
    )


class EpsilonGreedy(TensorDictModuleBase):
    """Writes `action` int64 [N]: with probability `epsilon` a random one, else the best; of those allowed.

    TorchRL's `EGreedyModule` draws from torch's global generator, and computes Q-values for every row. This
    module draws from the run's own generator, and on a CPU computes Q-values only for rows that do not
    explore. The number of draws does not depend on `epsilon`, which the training loop sets.

    `best` maps observations [N, ...], read from the key `observation`, to the best actions, int64 [N]. With
    an `action_mask_key`, as TorchRL's module has it, it also takes the allowed actions, bool [N, A].
    """

    def __init__(
        self,
        best: Callable[..., Tensor],
        observation: str,
        num_actions: int,
        generator: Generator,
        action_mask_key: str | None = None,
    ) -> None:
        super().__init__()
        self.in_keys, self.out_keys = [observation, *filter(None, [action_mask_key])], ["action"]
        self.best, self.num_actions, self.generator = best, num_actions, generator
        self.epsilon = 1.0

    @torch.no_grad()
    def forward(self, tensordict: TensorDictBase) -> TensorDictBase:
        """Choose an action for each row."""
        seen = [tensordict.get(key) for key in self.in_keys]
        count, device = seen[0].shape[0], seen[0].device
        explore = torch.rand(count, generator=self.generator, device=device) < self.epsilon
        if len(seen) == 1:
            action = torch.randint(self.num_actions, (count,), generator=self.generator, device=device)
        else:
            drawn = torch.rand((count, self.num_actions), generator=self.generator, device=device)
            action = mask_values(drawn, seen[1]).argmax(-1)
        if device.type == "cuda":
            # All rows: to know which ones explore would wait for all earlier operations.
            return tensordict.set("action", torch.where(explore, action, self.best(*seen)))
        explorers = sum(explore.tolist())
        if explorers == 0:
            action = self.best(*seen)
        elif explorers < count:
            action[~explore] = self.best(*(each[~explore] for each in seen))
        return tensordict.set("action", action)


@dataclass(frozen=True)
class Episode:
    """An episode of T steps and how it ended.

    Shapes: states float [T + 1, S], actions int64 [T], raw rewards float [T]; q_values float [T, A], or None
    if the policy wrote no `action_value`. `dcpa` is the least distance to any target ship in metres, infinite
    without target ships.
    """

    states: Tensor
    actions: Tensor
    q_values: Tensor | None
    rewards: Tensor
    goal: bool
    collision: bool
    dcpa: float

    @property
    def episode_return(self) -> float:
        """Undiscounted sum of raw rewards."""
        return float(self.rewards.sum(dtype=torch.float64))

    @property
    def length(self) -> int:
        """Number of steps."""
        return len(self.actions)

    @property
    def outcome(self) -> str:
        """How the episode ended: goal, collision or timeout."""
        return outcome(self.goal, self.collision)


def mean_return(episodes: Sequence[Episode]) -> float:
    """Return the mean return of episodes."""
    return sum(one.episode_return for one in episodes) / len(episodes)


def outcome(goal: bool, collision: bool) -> str:
    """Name the end of an episode: goal, collision or timeout."""
    return "goal" if goal else "collision" if collision else "timeout"


@torch.no_grad()
def rollout(env: EnvBase, policy: Policy) -> list[Episode]:
    """Roll out one episode in each of the N environments of a batch.

    The environment needs the keys `state`, `action`, `goal`, `collision` and `dcpa`. TorchRL's own `rollout`
    either stops when the first episode of a batch ends, or continues with new episodes.
    """
    current, kept, count = env.reset(), dict[NestedKey, Tensor](), 0
    running = torch.ones(env.batch_size, dtype=torch.bool, device=env.device)
    lengths = torch.zeros(env.batch_size, dtype=torch.int64, device=env.device)
    while bool(running.any()):
        stepped, current = env.step_and_maybe_reset(policy(current))
        keep(kept, count, stepped)
        count += 1
        lengths += running
        running &= ~stepped["next", "done"].squeeze(-1)
    # At once: each copy from a GPU waits for all earlier operations.
    kept = {key: value[:count].cpu() for key, value in kept.items()}
    return [extract_episode(kept, row, length) for row, length in enumerate(lengths.tolist())]


def keep(kept: dict[NestedKey, Tensor], count: int, step: TensorDictBase) -> None:
    """Copy the step after `count` others into tensors [T, N, ...], which double when they are full.

    Small tensors allocated between the pictures of each step would keep the memory of all of them.
    """
    for key in KEPT:
        value = step.get(key, None)
        if value is None:
            continue
        if key not in kept:
            kept[key] = value.new_empty((STEPS, *value.shape))
        elif count == len(kept[key]):
            kept[key] = torch.cat((kept[key], torch.empty_like(kept[key])))
        kept[key][count] = value


def extract_episode(kept: dict[NestedKey, Tensor], row: int, length: int) -> Episode:
    """Extract the first episode of one environment, of `length` steps."""

    def steps(key: NestedKey) -> Tensor:
        return kept[key][:length, row].clone()

    def last(key: str) -> Tensor:
        return kept["next", key][length - 1, row]

    return Episode(
        states=torch.cat((steps("state"), last("state")[None])),
        actions=steps("action"),
        rewards=steps(("next", "reward")).squeeze(-1),
        q_values=steps("action_value") if "action_value" in kept else None,
        goal=bool(last("goal")),
        collision=bool(last("collision")),
        dcpa=float(last("dcpa")),
    )


def jumpstart(
    env: EnvBase,
    draw: Draw,
    network: DuelingNetwork,
    kept: Collection[str],
    draws: int,
    generator: Generator,
) -> list[float]:
    """Compute the greedy returns of `draws` networks, which copy the layers `kept` of `network`.

    Their other layers are drawn anew; `network` stays as it is. One draw tells little: an untrained network
    often repeats one action, and may reach the goal by chance. The batch size of `env` limits how many
    episodes run side by side. `draw` maps states to pixels, and `generator` is on the CPU. `env` may write a
    mask.
    """
    redrawn = copy.deepcopy(network).cpu()
    networks = [copy.deepcopy(network) for _ in range(min(draws, env.batch_size[0]))]
    for each in networks:
        each.backend = Dense()
    returns: list[float] = []
    while len(returns) < draws:
        playing = networks[: draws - len(returns)]
        for each in playing:
            redrawn.reset(generator, kept)
            each.load_state_dict(redrawn.state_dict())
        returns += run_episodes(env, draw, playing)
    return returns


@torch.no_grad()
def run_episodes(env: EnvBase, draw: Draw, networks: Sequence[DuelingNetwork]) -> list[float]:
    """Run one greedy episode of each network, in the first rows of the batch, and return their returns."""
    step = env.reset()
    totals = torch.zeros(len(networks), dtype=torch.float64, device=env.device)
    running = list(range(len(networks)))
    while running:
        action = torch.zeros(env.batch_size, dtype=torch.int64, device=env.device)
        # All rows: on a GPU each number of rows would be captured anew.
        seen, allowed = draw(step["state"]), mask_of(step)
        for ship in running:
            q = networks[ship](seen[ship : ship + 1])
            action[ship] = mask_values(q, None if allowed is None else allowed[ship : ship + 1])[0].argmax()
        stepped, step = env.step_and_maybe_reset(step.set("action", action))
        after = stepped["next"]
        totals[running] += after["reward"][running, 0]
        ended = after["done"].squeeze(-1).tolist()
        running = [ship for ship in running if not ended[ship]]
    return [float(total) for total in totals]
