"""Watch policies in a window: which one on which case, the keys, and saved pictures and films."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from itertools import count
from pathlib import Path

import pygame

from ship_trl.config.errors import ConfigError
from ship_trl.files.disk import atomic_write
from ship_trl.policies.entry import Entry
from ship_trl.sim.cases import readable_cases
from ship_trl.sim.suites import Suite, suite_of
from ship_trl.view import pen
from ship_trl.view.dashboard import draw_dashboard
from ship_trl.view.episode_view import EpisodeView, view_entry
from ship_trl.view.film import draw_film, write_film
from ship_trl.view.window.window import Window

FOLDER = Path("outputs/watch")
SPEED = 5.0
FILM_FRAMES_PER_SECOND = 10


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
        super().__init__(SPEED)
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
