"""Windows: watch policies on cases, with saved pictures and films, or steer a ship yourself."""

from __future__ import annotations

import os
import re
import sys
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from itertools import count
from pathlib import Path

import pygame
import torch

from ship_trl.config.errors import ConfigError
from ship_trl.config.types import World
from ship_trl.fast.worlds import make_rasteriser
from ship_trl.files.disk import atomic_write
from ship_trl.policies.demonstrations import write_demonstration
from ship_trl.policies.reference import best_known
from ship_trl.policies.registry import Entry
from ship_trl.sim.cases import Case, Suite, readable_cases, suite_of
from ship_trl.sim.state import initial_state
from ship_trl.sim.transition import Transition
from ship_trl.view import pen
from ship_trl.view.dashboard import Look, draw_dashboard, step_at
from ship_trl.view.episode import EpisodeView, Telemetry, view_entry
from ship_trl.view.film import draw_film, write_film
from ship_trl.view.style import action_text, number

DRIVER = "SDL_VIDEODRIVER"
FRAMES_PER_SECOND = 60
# Share of the screen's sides that a window takes at most: its title and a task bar need room.
SHARE = 0.9
# Simulated seconds per real second.
SPEEDS = (0.5, 1.0, 2.0, 5.0, 10.0, 20.0)
# Of policies and of a player at first.
WATCHED_SPEED, PLAYED_SPEED = 5.0, 2.0
# Of saved pictures and films, whose frames a second follow; and the author of demonstrations.
FOLDER = Path("outputs/watch")
FILM_FRAMES_PER_SECOND = 10
AUTHOR = "keyboard"
# A line of the help: the keys, what they do, and the actions by pygame's names of the keys.
Binding = tuple[str, str, Mapping[str, Callable[[], object]]]


@contextmanager
def open_window(size: tuple[int, int], advice: str = "") -> Iterator[None]:
    """Open a resizable window that fits the screen, and close it; without a screen give `advice`.

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
        desktop = pygame.display.get_desktop_sizes()[0]
        width, height = (min(side, int(SHARE * most)) for side, most in zip(size, desktop, strict=True))
        pygame.display.set_mode((width, height), pygame.RESIZABLE)
        pygame.display.set_caption("ship_trl")
        pygame.key.set_repeat(350, 60)
        yield
    except pygame.error as error:
        raise ConfigError(f"no screen ({error}); {advice}") from None
    finally:
        pygame.display.quit()
        if not requested:
            os.environ.pop(DRIVER, None)


class Window(ABC):
    """Plays episodes in the open window, and handles keys and clicks.

    `position` is in steps, and a whole number while paused. A subclass sets `views`, and puts its own keys
    before the shared ones in `bindings`.
    """

    views: list[EpisodeView]

    def __init__(self, speed: float) -> None:
        self.position, self.is_running, self.speed = 0.0, True, speed
        self.look, self.has_help, self.is_closed = Look(), False, False
        relative, large = partial(self.toggle_look, "relative"), partial(self.toggle_look, "large")
        self.bindings: list[Binding] = [
            ("A", "own ship in the middle (relative frame), or north up (absolute)", {"a": relative}),
            ("T", "hulls as large as the network sees them, or to scale", {"t": large}),
            ("H", "these keys", {"h": self._toggle_help, "f1": self._toggle_help}),
            ("Q, Esc", "quit", {"q": self._close, "escape": self._escape}),
        ]

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

    @property
    def is_at_end(self) -> bool:
        """Whether nothing is left to play."""
        return self.position >= self.steps

    def advance(self, seconds: float) -> None:
        """Play for some real seconds, and pause at the end."""
        if self.is_running:
            steps = seconds * self.speed / self.views[0].telemetry.world.dt
            self.position = min(self.position + steps, float(self.steps))
            self.is_running = not self.is_at_end

    def pause(self) -> None:
        """Pause at the current step, or continue; at the end, restart."""
        if self.is_running:
            self.seek(int(self.position))
        elif self.is_at_end:
            self.restart()
        else:
            self.is_running = True

    def step(self, count: int) -> None:
        """Pause, and move by `count` whole steps."""
        is_back_from_between = count < 0 and self.position > int(self.position)
        self.seek(int(self.position) + count + is_back_from_between)

    def seek(self, step: int) -> None:
        """Pause at a step, or at the nearest one that exists."""
        self.is_running = False
        self.position = float(min(max(step, 0), self.steps))

    def restart(self) -> None:
        """Play from the start."""
        self.position, self.is_running = 0.0, True

    def change_speed(self, levels: int) -> None:
        """Move by `levels` in `SPEEDS`, as far as they go."""
        level = min(range(len(SPEEDS)), key=lambda k: abs(SPEEDS[k] - self.speed)) + levels
        self.speed = SPEEDS[min(max(level, 0), len(SPEEDS) - 1)]

    def toggle_look(self, name: str) -> None:
        """Turn one field of the look on or off."""
        self.look = replace(self.look, **{name: not getattr(self.look, name)})

    def show(self) -> pygame.Surface:
        """Draw the current picture in the open window; return its surface."""
        surface = pygame.display.get_surface()
        assert surface is not None
        keys = [binding[:2] for binding in self.bindings] if self.has_help else []
        draw_dashboard(surface, self.views, self.position, self.look, self.status, keys)
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
                step = step_at(pygame.display.get_window_size(), self.views, event.pos)
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
        for _, _, actions in self.bindings:
            if key in actions:
                actions[key]()

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

    def __init__(
        self, entries: Sequence[Entry], compare: bool = False, seed: int = 0, folder: Path = FOLDER
    ) -> None:
        super().__init__(WATCHED_SPEED)
        self.seed, self.folder, self._message = seed, folder, ""
        self.policies = distinct_policies(entries, compare)
        self.cases = distinct_cases([entry.suite for entry in entries])
        # With `target=1,4` every policy runs every case; result folders bring their own cases.
        has_own_cases = len(entries) != len(self.policies) * len(self.cases)
        if len(self.cases) == 1 or has_own_cases:
            world, perturbation = entries[0].world, entries[0].suite.perturbation
            shipped = (suite_of(case, perturbation) for case in readable_cases(world))
            self.cases = distinct_cases([*self.cases, *shipped])
        self._first, self._changes_case = int(compare), has_own_cases and not compare
        self.policy, self.case, self.episode = self._first, self.policies[0].suite, 0
        self.views = self._load(self.policy, self.case, self.episode)
        back, forward = partial(self.step, -1), partial(self.step, 1)
        faster, slower = partial(self.change_speed, 1), partial(self.change_speed, -1)
        restart, to_end = self.restart, (lambda: self.seek(self.steps))
        saliency = partial(self.toggle_look, "saliency")
        self.bindings[:0] = [
            ("Space", "pause, continue; at the end, replay", {"space": self.pause}),
            ("← →", "a step back, a step forward", {"left": back, "right": forward}),
            ("↑ ↓", "faster, slower", {"up": faster, "down": slower}),
            ("R, End", "to the start, to the end", {"r": restart, "home": restart, "end": to_end}),
            ("Click", "in a graph: to that step", {}),
            ("P, C", "next policy, next case", {"p": self.next_policy, "c": self.next_case}),
            ("E", "next episode: stochastic policies and starts draw again", {"e": self.next_episode}),
            ("S", "saliency: the pixels on which the highest Q depends", {"s": saliency}),
            (
                "I, M",
                f"save the picture, the film (to {FOLDER})",
                {"i": self.save_picture, "m": self.save_film},
            ),
        ]

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
        """Show the next policy, on its own case if it has one; in a comparison keep the first policy."""
        first = self._first
        policy = first + (self.policy - first + 1) % (len(self.policies) - first)
        self._show(policy, self.policies[policy].suite if self._changes_case else self.case, self.episode)

    def next_case(self) -> None:
        """Show the next of the given cases; if only one is given, of all cases."""
        self._show(self.policy, self.cases[(self._place + 1) % len(self.cases)], self.episode)

    def next_episode(self) -> None:
        """Roll out again; only stochastic policies differ then."""
        self._show(self.policy, self.case, self.episode + 1)

    def save_picture(self) -> None:
        """Save the current picture as a PNG, without the help."""
        picture = pen.new_surface(*pygame.display.get_window_size())
        draw_dashboard(picture, self.views, self.position, self.look)
        step = f"step{int(self.position):02d}"
        self._save(step, ".png", lambda path: pygame.image.save(picture, str(path)))

    def save_film(self) -> None:
        """Save the whole episode as a GIF with the current look; that takes a while."""
        self._message = "making the film ..."
        self.show()
        size = pygame.display.get_window_size()
        frames = draw_film([self.views], self.look, size, FILM_FRAMES_PER_SECOND, self.speed)
        self._save("film", ".gif", lambda path: write_film(path, frames, FILM_FRAMES_PER_SECOND))

    def _save(self, what: str, suffix: str, write: Callable[[Path], None]) -> None:
        """Write a file under a new name; show where it is, or why it could not be written."""
        titles = "-".join(view.title for view in self.views)
        name = re.sub(r"[^\w]+", "-", f"case{self.case.name}-{titles}").strip("-")[-80:]
        names = (f"{name}-{what}{'' if k == 1 else f'-{k}'}{suffix}" for k in count(1))
        path = next(self.folder / name for name in names if not (self.folder / name).exists())
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            with atomic_write(path) as draft:
                write(draft)
            self._message = f"saved {path}"
        except (OSError, pygame.error) as error:
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

    `actions` are those of the episode so far; `rudder` is the index of the next one.
    """

    def __init__(
        self, cases: list[Case], world: World, folder: Path | None, speed: float = PLAYED_SPEED
    ) -> None:
        super().__init__(speed)
        self.cases, self.world, self.folder = cases, world, folder
        self.kept: list[Path] = []
        turns = [turn for _, turn in world.actions]
        self._port_to_starboard = sorted(range(len(turns)), key=lambda k: -turns[k])
        self._place = 0
        self.begin(0)
        digits = {str(k + 1): partial(self.steer, k) for k in range(len(turns))}
        port, starboard = partial(self.turn, -1), partial(self.turn, 1)
        straight = partial(self.steer, world.straight_action)
        faster, slower = partial(self.change_speed, 1), partial(self.change_speed, -1)
        self.bindings[:0] = [
            ("← →", "the next action to port, to starboard", {"left": port, "right": starboard}),
            ("↑", "keep course, full speed", {"up": straight}),
            ("1 to 7", "the actions a1 to a7 of table 1", digits),
            ("Space", "start, pause; at the end, play again", {"space": self.pause}),
            ("+ \N{MINUS SIGN}", "faster, slower", {"+": faster, "=": faster, "-": slower}),
            ("R", "restart; the episode is not kept", {"r": partial(self.begin, 0)}),
            ("C", "next case", {"c": partial(self.begin, 1)}),
        ]

    @property
    def telemetry(self) -> Telemetry:
        """The episode so far."""
        return self.views[0].telemetry

    @property
    def is_over(self) -> bool:
        """Whether the episode has ended."""
        return self.telemetry.outcome is not None

    @property
    def status(self) -> str:
        """How the episode ended, or the rudder and the best known return."""
        if self.is_over:
            return self._message
        words = f"rudder a{self.rudder + 1}, {action_text(self.world, self.rudder)}"
        return f"{words}    {self._message or 'best known ' + number(self.best, '.1f')}    H: keys"

    def begin(self, forward: int) -> None:
        """Wait at the start of the case that is `forward` places further in the list."""
        self._place = (self._place + forward) % len(self.cases)
        self.case = self.cases[self._place]
        self.actions, self.rudder = list[int](), self.world.straight_action
        self.best = best_known(self.case, self.world).episode_return
        self._motion = Transition(self.world)
        self._states = [initial_state(self.case, self.world)[None]]
        self._rasteriser = make_rasteriser(self.world)
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
        if self.is_over and self.is_at_end:
            self.begin(0)
        self._message = ""
        self.is_running = not self.is_running

    def tick(self, seconds: float) -> bool:
        """Play on; the ship takes its next action when the last one is played."""
        if not self.is_running:
            return False
        if self.is_at_end and not self.is_over:
            self._states.append(self._motion(self._states[-1], torch.tensor([self.rudder])).state)
            self.actions.append(self.rudder)
            self._measure()
        self.advance(seconds)
        if self.is_at_end and self.is_over:
            self.finish()
        else:
            # It pauses after each action, but the episode continues.
            self.is_running = True
        return True

    def finish(self) -> None:
        """Show how the episode ended, and keep it."""
        total, outcome = float(self.telemetry.total[-1]), str(self.telemetry.outcome)
        self._message = f"{outcome}: {number(total, '.1f')} of {number(self.best, '.1f')}"
        if self.folder is not None:
            ended = total, outcome
            try:
                path = write_demonstration(self.folder, self.case, self.world, self.actions, ended, AUTHOR)
                self.kept.append(path)
                self._message += f", kept as {path.name}"
            except OSError as error:
                self._message += f", not kept: {error.strerror}"
        self._message += "; Space: play again"

    def _measure(self) -> None:
        actions = torch.tensor(self.actions, dtype=torch.int64)
        telemetry = Telemetry(self.case, self.world, torch.cat(self._states), actions)
        self.views = [EpisodeView("you", telemetry, self._rasteriser)]
