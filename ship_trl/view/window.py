"""Windows: watch policies on cases, with saved pictures and films, or steer a ship yourself."""

from __future__ import annotations

import math
import os
import re
import sys
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from itertools import chain, count
from pathlib import Path

import pygame
import torch

from ship_trl.config.errors import ConfigError
from ship_trl.config.types import World
from ship_trl.fast.worlds import make_rasteriser
from ship_trl.policies.demonstrations import write_demonstration
from ship_trl.policies.reference import best_known
from ship_trl.policies.registry import Entry
from ship_trl.sim.cases import Case, Suite, readable_cases, suite_of
from ship_trl.sim.replay import with_replay
from ship_trl.sim.state import initial_state
from ship_trl.sim.transition import Transition
from ship_trl.view import pen
from ship_trl.view.dashboard import Look, draw_dashboard, step_at
from ship_trl.view.episode import EpisodeView, Telemetry, view_entry
from ship_trl.view.film import STEPS_PER_SECOND, draw_film, write_film
from ship_trl.view.style import action_text, number

DRIVER = "SDL_VIDEODRIVER"
FRAMES_PER_SECOND = 60
# Share of the screen's sides that a window takes at most: its title and a task bar need room. Without a size
# it is as large as this allows, in this ratio of width to height.
SHARE, RATIO = 0.9, 16 / 9
# The least picture in pixels.
LEAST = (320, 200)
# Simulated seconds per real second; the first of policies, and of a player.
SPEEDS = (0.5, 1.0, 2.0, 5.0, 10.0, 20.0)
WATCHED_SPEED, PLAYED_SPEED = 5.0, 2.0
# Of saved pictures and films.
FOLDER = Path("outputs/watch")
# Keys that all windows share, and what they do.
SHARED_HELP = (
    ("A", "own ship in the middle (relative frame), or north up (absolute)"),
    ("T", "hulls as large as the network sees them, or to scale"),
    ("H", "these keys"),
    ("Q, Esc", "quit"),
)


@contextmanager
def open_window(size: tuple[int, int] | None, advice: str = "") -> Iterator[None]:
    """Open a resizable window that fits the screen, and close it; without a screen give `advice`.

    The window has the `size` in pixels where the screen is large enough; by default it is as large as fits.

    Raises:
        ConfigError: there is no screen.
    """
    requested = os.environ.get(DRIVER)
    if not requested and sys.platform.startswith("linux"):
        drivers = {"WAYLAND_DISPLAY": "wayland", "DISPLAY": "x11"}
        available = [driver for name, driver in drivers.items() if os.environ.get(name)]
        if not available:
            raise ConfigError(f"no screen (neither DISPLAY nor WAYLAND_DISPLAY is set); {advice}")
        # Without a list SDL tries other drivers too, some of which show nothing.
        os.environ[DRIVER] = ",".join(available)
    # By default SDL copies each frame into a texture. Where OpenGL runs on the CPU, that takes four times
    # as long as drawing the frame.
    os.environ.setdefault("SDL_FRAMEBUFFER_ACCELERATION", "0")
    try:
        pygame.display.init()
        width, height = (int(SHARE * side) for side in pygame.display.get_desktop_sizes()[0])
        wanted = size or (round(min(width, RATIO * height)), round(min(height, width / RATIO)))
        pygame.display.set_mode((min(wanted[0], width), min(wanted[1], height)), pygame.RESIZABLE)
        pygame.display.set_caption("ship_trl")
        pygame.key.set_repeat(350, 60)
        yield
    except pygame.error as error:
        raise ConfigError(f"no screen ({error}); {advice}") from None
    finally:
        pygame.display.quit()
        if not requested:
            os.environ.pop(DRIVER, None)


def canvas_size() -> tuple[int, int]:
    """Return the size in pixels of the picture in the open window, which a user may make very small."""
    width, height = pygame.display.get_window_size()
    return max(width, LEAST[0]), max(height, LEAST[1])


class Window(ABC):
    """Plays episodes in the open window, and handles keys and clicks.

    `position` is in steps, and a whole number while paused. A subclass sets `views`, what its keys do by
    pygame's names for them, and `help`, the lines about them.
    """

    views: list[EpisodeView]
    help: tuple[tuple[str, str], ...] = ()

    def __init__(self, speed: float) -> None:
        self.position, self.is_running, self.speed = 0.0, True, speed
        self.look, self.has_help, self.is_closed = Look(), False, False
        self.keys: dict[str, Callable[[], object]] = {"h": self._toggle_help, "f1": self._toggle_help}
        self.keys |= {"q": self._close, "escape": self._escape, "t": lambda: self.toggle_look("large")}
        self.keys["a"] = lambda: self.toggle_look("relative")

    @property
    @abstractmethod
    def status(self) -> str:
        """The text at the top right."""

    @abstractmethod
    def tick(self, seconds: float) -> bool:
        """Let real time pass; return whether the picture has changed."""

    @property
    def steps(self) -> int:
        """Number of steps of the longest episode shown."""
        return max(view.telemetry.steps for view in self.views)

    def advance(self, seconds: float) -> None:
        """Play for some real seconds, and pause at the end."""
        if self.is_running:
            steps = seconds * self.speed / self.views[0].telemetry.world.dt
            self.position = min(self.position + steps, float(self.steps))
            self.is_running = self.position < self.steps

    def pause(self) -> None:
        """Pause at the current step, or continue; at the end, restart."""
        if self.is_running:
            self.seek(int(self.position))
        elif self.position >= self.steps:
            self.restart()
        else:
            self.is_running = True

    def step(self, count: int) -> None:
        """Pause, and move by `count` whole steps."""
        self.seek((math.ceil if count < 0 else math.floor)(self.position) + count)

    def seek(self, step: int) -> None:
        """Pause at a step, or at the nearest one that exists."""
        self.is_running = False
        self.position = float(min(max(step, 0), self.steps))

    def restart(self) -> None:
        """Play from the start."""
        self.position, self.is_running = 0.0, True

    def change_speed(self, levels: int) -> None:
        """Move by `levels` in `SPEEDS`, as far as they go."""
        self.speed = SPEEDS[min(max(SPEEDS.index(self.speed) + levels, 0), len(SPEEDS) - 1)]

    def toggle_look(self, name: str) -> None:
        """Turn one field of the look on or off."""
        self.look = replace(self.look, **{name: not getattr(self.look, name)})

    def show(self) -> pygame.Surface:
        """Draw the current picture in the open window; return its surface."""
        surface = pygame.display.get_surface()
        assert surface is not None
        lines = (*self.help, *SHARED_HELP) if self.has_help else ()
        size = surface.get_size()
        picture = surface if size == canvas_size() else pen.new_surface(*canvas_size())
        draw_dashboard(picture, self.views, self.position, self.look, self.status, lines)
        if picture is not surface:
            surface.blit(pygame.transform.smoothscale(picture, size), (0, 0))
        pygame.display.flip()
        return surface

    def handle_events(self) -> bool:
        """Handle the events since the last call; return whether to draw again."""
        events = pygame.event.get()
        for event in events:
            if event.type == pygame.QUIT:
                self._close()
            elif event.type == pygame.KEYDOWN:
                self.press(pygame.key.name(event.key))
            elif (event.type == pygame.MOUSEBUTTONDOWN and event.button == 1) or (
                event.type == pygame.MOUSEMOTION and event.buttons[0]
            ):
                step = step_at(canvas_size(), self.views, event.pos)
                if step is not None:
                    self.seek(step)
        return any(event.type != pygame.MOUSEMOTION or event.buttons[0] for event in events)

    def run(self) -> None:
        """Run until the window is closed; draw only after a change."""
        clock, has_changed = pygame.time.Clock(), True
        while not self.is_closed:
            if has_changed:
                self.show()
            has_changed = self.tick(clock.tick(FRAMES_PER_SECOND) / 1000)
            has_changed = self.handle_events() or has_changed

    def press(self, key: str) -> None:
        """Do what a key stands for, by pygame's name for it ("space", "left", "a")."""
        if key in self.keys:
            self.keys[key]()

    def _toggle_help(self) -> None:
        self.has_help = not self.has_help

    def _escape(self) -> None:
        """Leave the help, or close the window."""
        self.has_help, self.is_closed = False, not self.has_help

    def _close(self) -> None:
        self.is_closed = True


class Session(Window):
    """Plays policies on single cases, one at a time or two side by side; saves pictures and films.

    `seed` is for the first episode of stochastic policies and perturbed starts; each further episode has the
    next seed. A message stays until the next key.

    Raises:
        ConfigError: the first policy cannot be loaded, or there is only one to compare.
    """

    help = (
        ("Space", "pause, continue; at the end, replay"),
        ("← →", "a step back, a step forward"),
        ("↑ ↓", "faster, slower"),
        ("R, End", "to the start, to the end"),
        ("Click", "in a graph: to that step"),
        ("P, C", "next policy, next case"),
        ("E", "next episode: stochastic policies and starts draw again"),
        ("S", "saliency: the pixels on which the highest Q depends"),
        ("I, M", f"save the picture, the film (to {FOLDER})"),
    )

    def __init__(
        self, entries: Sequence[Entry], compare: bool = False, seed: int = 0, folder: Path = FOLDER
    ) -> None:
        super().__init__(WATCHED_SPEED)
        self.keys |= {"space": self.pause, "left": lambda: self.step(-1), "right": lambda: self.step(1)}
        self.keys |= {"up": lambda: self.change_speed(1), "down": lambda: self.change_speed(-1)}
        self.keys |= {"r": self.restart, "home": self.restart, "end": lambda: self.seek(self.steps)}
        self.keys |= {"p": self.next_policy, "c": self.next_case, "e": self.next_episode}
        self.keys |= {"s": lambda: self.toggle_look("saliency"), "i": self.save_picture, "m": self.save_film}
        self.seed, self.folder, self._message = seed, folder, ""
        self.policies = distinct_policies(entries, compare)
        self.cases = distinct_cases([entry.suite for entry in entries])
        # With `target=1,4` every policy runs every case; result folders bring their own cases.
        has_own_cases = len(entries) != len(self.policies) * len(self.cases)
        if len(self.cases) == 1 or has_own_cases:
            world, perturbation = entries[0].world, entries[0].suite.perturbation
            shipped = (suite_of(case, perturbation) for case in readable_cases(world))
            self.cases = distinct_cases([*self.cases, *shipped])
        # In a comparison the first policy stays, and the others follow it.
        self._first, self._changes_case = int(compare), has_own_cases and not compare
        self.policy, self.case, self.episode = self._first, self.policies[0].suite, 0
        self.views = self._load(self.policy, self.case, self.episode)

    @property
    def status(self) -> str:
        """A message, or which of several cases it plays, and how fast."""
        sign = "\N{BLACK RIGHT-POINTING TRIANGLE}" if self.is_running else "\N{MEDIUM VERTICAL BAR}" * 2
        place = f"{self._place + 1} of {len(self.cases)}"
        return self._message or f"{place}    {sign}  {self.speed:g}\N{MULTIPLICATION SIGN}    H: keys"

    @property
    def _place(self) -> int:
        """The index of the case that is shown."""
        return [case.fingerprint for case in self.cases].index(self.case.fingerprint)

    def tick(self, seconds: float) -> bool:
        """Play on; return whether the picture has changed."""
        was_running = self.is_running
        self.advance(seconds)
        return was_running

    def press(self, key: str) -> None:
        """Remove the message, and do what a key stands for."""
        self._message = ""
        super().press(key)

    def next_policy(self) -> None:
        """Show the next policy, on its own case if it has one."""
        policy = self.policy + 1 if self.policy + 1 < len(self.policies) else self._first
        self._show(policy, self.policies[policy].suite if self._changes_case else self.case, self.episode)

    def next_case(self) -> None:
        """Show the next of the given cases; if only one is given, of all cases."""
        self._show(self.policy, self.cases[(self._place + 1) % len(self.cases)], self.episode)

    def next_episode(self) -> None:
        """Roll out again; only stochastic policies and starts differ then."""
        self._show(self.policy, self.case, self.episode + 1)

    def save_picture(self) -> None:
        """Save the current picture as a PNG, without the help."""
        picture = pen.new_surface(*canvas_size())
        draw_dashboard(picture, self.views, self.position, self.look)
        self._save(f"step{int(self.position):02d}.png", partial(pen.save, picture))

    def save_film(self) -> None:
        """Save the whole episode as a GIF with the current look; that takes a while."""
        self._message = "making the film ..."
        self.show()
        frames = draw_film(self.views, self.look, canvas_size(), STEPS_PER_SECOND, self.speed)
        self._save("film.gif", lambda path: write_film(path, frames, STEPS_PER_SECOND))

    def _save(self, ending: str, write: Callable[[Path], None]) -> None:
        """Write a file under a new name; show where it is, or why it could not be written."""
        titles = "-".join(view.title for view in self.views)
        name = re.sub(r"[^\w]+", "-", f"case{self.case.name}-{titles}").strip("-")[-80:]
        path = self.folder / f"{name}-{ending}"
        names = (path.with_stem(f"{path.stem}-{k}") for k in count(2))
        path = next(one for one in chain([path], names) if not one.exists())
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            write(path)
            self._message = f"saved {path}"
        except OSError as error:
            self._message = f"not saved: {error}"

    def _show(self, policy: int, case: Suite, episode: int) -> None:
        """Show a policy on a case; if it cannot be loaded, show only why."""
        try:
            self.views = self._load(policy, case, episode)
        except ConfigError as error:
            self._message = str(error)
            return
        self.policy, self.case, self.episode = policy, case, episode
        self.restart()

    def _load(self, policy: int, case: Suite, episode: int) -> list[EpisodeView]:
        """Roll out a policy; in a comparison, also the first policy."""
        places = [0, policy] if self._first else [policy]
        entries = [replace(self.policies[place], suite=case) for place in places]
        return [view_entry(entry, self.seed + episode, episode + 1) for entry in entries]


def distinct_policies(entries: Sequence[Entry], compare: bool) -> list[Entry]:
    """Return one entry for each policy, in order.

    Raises:
        ConfigError: there is only one policy to compare.
    """
    policies = list({entry.policy: entry for entry in reversed(entries)}.values())[::-1]
    if compare and len(policies) < 2:
        raise ConfigError(f"--compare: needs two policies, got {policies[0].label} alone")
    return policies


def distinct_cases(cases: Sequence[Suite]) -> list[Suite]:
    """Drop repeated cases, even if their names differ."""
    return list({case.fingerprint: case for case in reversed(cases)}.values())[::-1]


class Game(Window):
    """Lets a person steer; finished episodes are kept in `folder`, unless it is None.

    `actions` were taken in the episode so far; `rudder` is the index of the next one.
    """

    help = (
        ("← →", "the next action to port, to starboard"),
        ("↑", "keep course, full speed"),
        ("1 to 7", "the actions a1 to a7 of table 1"),
        ("Space", "start, pause; at the end, play again"),
        ("+ \N{MINUS SIGN}", "faster, slower"),
        ("R", "restart; the episode is not kept"),
        ("C", "next case"),
    )

    def __init__(self, cases: list[Case], world: World, folder: Path | None) -> None:
        super().__init__(PLAYED_SPEED)
        faster, straight = partial(self.change_speed, 1), partial(self.steer, world.straight_action)
        self.keys |= {str(k + 1): partial(self.steer, k) for k in range(len(world.actions))}
        self.keys |= {"left": lambda: self.turn(-1), "right": lambda: self.turn(1), "up": straight}
        self.keys |= {"space": self.pause, "r": lambda: self.begin(0), "c": lambda: self.begin(1)}
        self.keys |= {"+": faster, "=": faster, "-": lambda: self.change_speed(-1)}
        self.cases, self.world, self.folder, self.kept = cases, world, folder, list[Path]()
        self._port_to_starboard = sorted(range(len(world.actions)), key=lambda k: -world.actions[k][1])
        self._place = 0
        self.begin(0)

    @property
    def telemetry(self) -> Telemetry:
        """The episode so far; its outcome is None until it has ended."""
        return self.views[0].telemetry

    @property
    def status(self) -> str:
        """How the episode ended, or the rudder and the best known return."""
        if self.telemetry.outcome:
            return self._message
        words = f"rudder a{self.rudder + 1}, {action_text(self.world, self.rudder)}"
        return f"{words}    {self._message or 'best known ' + number(self.best, '.1f')}    H: keys"

    def begin(self, forward: int) -> None:
        """Wait at the start of the case that is `forward` places further in the list."""
        self._place = (self._place + forward) % len(self.cases)
        self.case = self.cases[self._place]
        self.actions, self.rudder = list[int](), self.world.straight_action
        self.best = best_known(self.case, self.world).episode_return
        self._motion = with_replay(Transition(self.world), suite_of(self.case), self.world)
        self._rasteriser = make_rasteriser(self.world)
        self._states = [initial_state(self.case, self.world)[None]]
        self.position, self.is_running, self._message = 0.0, False, "Space: start"
        self._measure()

    def steer(self, action: int) -> None:
        """Choose the next action."""
        self.rudder = action

    def turn(self, count: int) -> None:
        """Move the rudder by `count` actions to starboard, as far as they go."""
        place = self._port_to_starboard.index(self.rudder) + count
        self.rudder = self._port_to_starboard[min(max(place, 0), len(self._port_to_starboard) - 1)]

    def pause(self) -> None:
        """Pause or continue; after the end of the episode, begin again."""
        if self.telemetry.outcome and self.position >= self.steps:
            self.begin(0)
        self._message = ""
        self.is_running = not self.is_running

    def tick(self, seconds: float) -> bool:
        """Play on; the ship takes its next action when the last one is played."""
        if not self.is_running:
            return False
        if self.position >= self.steps and not self.telemetry.outcome:
            self._states.append(self._motion(self._states[-1], torch.tensor([self.rudder])).state)
            self.actions.append(self.rudder)
            self._measure()
        self.advance(seconds)
        if self.position >= self.steps and self.telemetry.outcome:
            self._keep(self.telemetry.outcome)
        else:
            # It pauses after each action, but the episode continues.
            self.is_running = True
        return True

    def _keep(self, outcome: str) -> None:
        """Show how the episode ended, and keep it."""
        total = float(self.telemetry.total[-1])
        self._message = f"{outcome}: {number(total, '.1f')} of {number(self.best, '.1f')}"
        if self.folder is not None:
            ended = total, outcome
            try:
                path = write_demonstration(
                    self.folder, self.case, self.world, self.actions, ended, "keyboard"
                )
                self.kept.append(path)
                self._message += f", kept as {path.name}"
            except OSError as error:
                self._message += f", not kept: {error.strerror}"
        self._message += "; Space: play again"

    def _measure(self) -> None:
        actions = torch.tensor(self.actions, dtype=torch.int64)
        telemetry = Telemetry(self.world, torch.cat(self._states), actions)
        self.views = [EpisodeView(self.case, "you", telemetry, self._rasteriser)]
