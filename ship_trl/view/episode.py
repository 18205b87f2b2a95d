"""An episode to show: its numbers after each step, what the network sees, which pixels its Q depends on."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter
from torch import Tensor

from ship_trl.config.types import World
from ship_trl.learn.network import DuelingNetwork
from ship_trl.learn.rollout import Episode, outcome
from ship_trl.policies.named import network_of, rollout_entry
from ship_trl.policies.registry import Entry
from ship_trl.sim import state as col
from ship_trl.sim.cases import Case
from ship_trl.sim.encounter import relative_motion
from ship_trl.sim.geometry import closest_approach
from ship_trl.sim.render import Rasteriser
from ship_trl.sim.replay import as_moved
from ship_trl.sim.state import first_case, goal_distance, select_ships, target_ships
from ship_trl.sim.transition import Transition

Numbers = NDArray[np.float64]
# Moments in a step at which `closest_places` looks.
MOMENTS_PER_STEP = 20
# Pixels by which the gradient is blurred: single pixels show the stride of the first layer.
BLUR = 1.5


class Telemetry:
    """The numbers of an episode so far, of T steps and K target ships, in metres, seconds and radians.

    Args:
        world: physics and reward.
        states: states float [T + 1, S], see `sim.state`.
        actions: indices of the actions taken, int64 [T].
        q_values: of all actions, float [T, A]; None if the policy has none.

    Attributes:
        ships: positions of the target ships, [T + 1, K, 2].
        headings: headings of the target ships, [T + 1, K].
        speeds: speeds of the target ships, [T + 1, K].
        terms: return so far by reward term, each [T + 1].
        total: return so far, [T + 1].
        goal_distance: distance to the goal, [T + 1].
        apart: distance of each target ship, [T + 1, K].
        closest: least distance so far, between steps too, [T + 1, K].
        dcpa: predicted if all ships keep course and speed, [T + 1, K].
        tcpa: predicted likewise, [T + 1, K].
        outcome: goal, collision or timeout; None while the episode has not ended.
    """

    def __init__(self, world: World, states: Tensor, actions: Tensor, q_values: Tensor | None = None) -> None:
        self.world, transition = world, Transition(world)
        # Of a suite, empty places for target ships are left out.
        states = select_ships(states, range(int(states[0, col.SHIP_COUNT])))
        after = transition(as_moved(states[:-1], states[1:]), actions)
        goal, collision, end = (bool(f[-1:].any()) for f in (after.goal, after.collision, after.truncated))
        self.outcome = outcome(goal, collision) if goal or collision or end else None
        terms = transition.reward_terms(actions, after)
        self.terms = {name: _return_so_far(rewards) for name, rewards in terms.items()}
        self.total = _return_so_far(after.reward)
        self.states, self.actions = _numbers(states), actions.cpu().numpy().astype(np.int64)
        self.q_values = None if q_values is None else _numbers(q_values)
        ships = target_ships(states)
        self.ships, self.headings = (
            _numbers(ships[..., : col.SHIP_Y + 1]),
            _numbers(ships[..., col.SHIP_HEADING]),
        )
        self.speeds = _numbers(ships[..., col.SHIP_SPEED])
        self.goal_distance = _numbers(goal_distance(states))
        motion = relative_motion(states)
        away, self.apart = motion.position, _numbers(motion.distance)
        within = torch.cat((motion.distance[:1], closest_approach(away[:-1], away[1:])))
        self.closest = _numbers(within.cummin(0).values if within.numel() else within)
        self.dcpa, self.tcpa = _numbers(motion.dcpa), _numbers(motion.tcpa)

    @property
    def steps(self) -> int:
        """Number of steps so far."""
        return len(self.actions)

    def at(self, position: float) -> tuple[Numbers, Numbers]:
        """Return x, y, heading [3] of own ship and the target ships [K, 2] at a step or between two.

        The simulated ship turns at the start of a step; here it turns gradually, to look natural.
        """
        position = min(max(position, 0.0), float(self.steps))
        before = min(int(position), max(0, self.steps - 1))
        after, share = min(before + 1, self.steps), position - before
        own = (1 - share) * self.states[before, :3] + share * self.states[after, :3]
        return own, (1 - share) * self.ships[before] + share * self.ships[after]

    def closest_places(self) -> tuple[Numbers, Numbers] | None:
        """Return own ship [2] and the nearest ship [2] at the closest approach; None without target ships."""
        moments = [self.at(k / MOMENTS_PER_STEP) for k in range(MOMENTS_PER_STEP * self.steps + 1)]
        pairs = [(own[:2], ship) for own, ships in moments for ship in ships]
        return min(pairs, key=lambda pair: math.dist(*pair), default=None)

    def action(self, step: int) -> int | None:
        """Return the action taken at a step, or None after the last one."""
        return int(self.actions[step]) if step < self.steps else None

    def q(self, step: int) -> Numbers | None:
        """Return the Q-values of all actions [A] at a step, or None where there are none."""
        return None if self.q_values is None or step >= self.steps else self.q_values[step]

    def is_danger(self, step: int, ship: int) -> bool:
        """Return whether a ship will enter the safe distance if all keep course and speed."""
        return bool(self.tcpa[step, ship] > 0 and self.dcpa[step, ship] < self.world.safe_distance)


def measure_episode(world: World, episode: Episode) -> Telemetry:
    """Measure a finished episode."""
    return Telemetry(world, episode.states, episode.actions, episode.q_values)


def _numbers(values: Tensor) -> Numbers:
    return values.double().numpy()


def _return_so_far(rewards: Tensor) -> Numbers:
    """Sum rewards [T] to returns [T + 1] that begin with 0."""
    return np.concatenate(([0.0], rewards.double().cumsum(0).numpy()))


@dataclass(frozen=True, eq=False)
class EpisodeView:
    """An episode of a case, finished or not, and its title."""

    case: Case
    title: str
    telemetry: Telemetry
    rasteriser: Rasteriser
    network: DuelingNetwork | None = None

    def see(self, step: int) -> Tensor:
        """Draw the scene at a step as a network sees pixels: uint8 [C, 84, 84]."""
        state = torch.from_numpy(self.telemetry.states[step]).float()
        return self.rasteriser(state.to(self.rasteriser.device))

    @property
    def sees_numbers(self) -> bool:
        """Whether the network sees numbers in place of the picture."""
        return self.network is not None and bool(self.network.config.linear)

    def salience(self, step: int) -> NDArray[np.float32] | None:
        """Return the `saliency` at a step, or None without a network that sees pixels."""
        if self.network is None or self.sees_numbers:
            return None
        return saliency(self.network, self.see(step))


def view_entry(entry: Entry, seed: int, episode: int = 1) -> EpisodeView:
    """Roll out an entry; from 2 on, the title states the number of the episode.

    Raises:
        ConfigError: the policy cannot be loaded.
    """
    env, policy, (first, *_) = rollout_entry(entry, 1, seed)
    title = entry.label + (f", episode {episode}" if episode > 1 else "")
    case, telemetry = first_case(entry.suite, first.states[0]), measure_episode(entry.world, first)
    return EpisodeView(case, title, telemetry, env.rasteriser, network_of(policy))


def saliency(network: DuelingNetwork, pixels: Tensor) -> NDArray[np.float32]:
    """Compute how strongly the highest Q-value depends on each pixel: uint8 [C, 84, 84] to float32 [84, 84].

    This is the absolute gradient, summed over channels, blurred, and scaled to a maximum of 1.
    """
    with torch.enable_grad():
        # Convolve whole pictures: the incremental conv layers have no gradient for pixels.
        picture = pixels[None].float().requires_grad_()
        q = network.dense_q_values(picture)
        (gradient,) = torch.autograd.grad(q.max(), picture)
    blurred: NDArray[np.float32] = gaussian_filter(gradient.abs().sum((0, 1)).cpu().numpy(), BLUR)
    highest = float(blurred.max())
    return blurred / highest if highest > 0 else blurred
