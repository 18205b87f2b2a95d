"""Episodes for tests of pictures, with given actions and made-up Q-values, and helpers to draw them."""

from collections.abc import Sequence

import numpy as np
import pygame
import torch
from numpy.typing import NDArray
from torch import Generator, Tensor

from ship_trl.config.types import World
from ship_trl.fast.worlds import make_env, make_rasteriser
from ship_trl.learn.network import DuelingNetwork
from ship_trl.learn.rollout import Episode
from ship_trl.policies.registry import Entry
from ship_trl.sim.cases import Case, load_suite, load_world
from ship_trl.view import pen
from ship_trl.view.dashboard import Look, draw_dashboard
from ship_trl.view.episode import EpisodeView, measure_episode
from ship_trl.view.window import Window


def run_actions(case: Case, world: World, actions: Sequence[int]) -> Episode:
    """Repeat the actions until the episode ends; the chosen action has the highest Q."""
    env = make_env(case, world, 1)
    step = env.reset()
    states: list[Tensor] = [step["state"][0]]
    chosen: list[Tensor] = []
    rewards: list[Tensor] = []
    while not bool(step["done"].all()):
        action = torch.tensor([actions[len(chosen) % len(actions)]])
        step = env.step(step.set("action", action))["next"]
        states.append(step["state"][0])
        chosen.append(action[0])
        rewards.append(step["reward"][0, 0])
    taken = torch.stack(chosen)
    q_values = 0.3 - 0.05 * (torch.arange(len(world.actions)) - taken[:, None]).abs()
    return Episode(
        states=torch.stack(states),
        actions=taken,
        q_values=q_values,
        rewards=torch.stack(rewards),
        goal=bool(step["goal"]),
        collision=bool(step["collision"]),
        dcpa=float(step["dcpa"]),
    )


def entry(policy: str = "keep_course", case: str = "4") -> Entry:
    """A policy on a shipped case."""
    world = load_world()
    return Entry(policy, policy, load_suite(case, world), world, colour=False)


def view(case: Case, world: World, actions: Sequence[int], network: bool = False) -> EpisodeView:
    """An episode with made-up Q-values, perhaps of an untrained network."""
    telemetry = measure_episode(world, run_actions(case, world, actions))
    made = DuelingNetwork(1, len(world.actions), Generator().manual_seed(0)) if network else None
    return EpisodeView(case, "made up", telemetry, make_rasteriser(world), made)


def drawn(
    views: Sequence[EpisodeView],
    position: float,
    look: Look | None = None,
    size: tuple[int, int] = (1600, 900),
) -> NDArray[np.uint8]:
    """The pixels of a dashboard."""
    surface = pen.new_surface(*size)
    draw_dashboard(surface, views, position, look or Look())
    return pen.to_array(surface)


def post(*keys: str) -> None:
    """Put keys into SDL's queue."""
    for key in keys:
        pygame.event.post(pygame.event.Event(pygame.KEYDOWN, key=pygame.key.key_code(key)))


def press(window: Window, *keys: str) -> NDArray[np.uint8]:
    """Press keys in the window, and return what it shows then."""
    post(*keys)
    window.handle_events()
    return pen.to_array(window.show())
