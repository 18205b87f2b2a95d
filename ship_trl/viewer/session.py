"""Somebody watching: what each key does, and what is shown after it."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import pygame

from ship_trl.config.errors import ConfigError
from ship_trl.files.disk import replacing
from ship_trl.viewer.film import draw_film, write_film
from ship_trl.viewer.player import Player
from ship_trl.viewer.playlist import Playlist
from ship_trl.viewer.screen import Screen
from ship_trl.viewer.window import Press, Window

FOLDER = Path("outputs/watch")
KEYS = (
    ("Space", "pause, go on; at the end, once more"),
    ("\N{LEFTWARDS ARROW} \N{RIGHTWARDS ARROW}", "a step back, a step on"),
    ("\N{UPWARDS ARROW} \N{DOWNWARDS ARROW}", "faster, slower"),
    ("R, End", "restart, to the end"),
    ("Click", "in a graph: to that step"),
    ("P, C", "next policy, next case"),
    ("E", "next episode: a policy that draws does so anew"),
    ("A", "absolute frame (north up), or relative (own ship in the middle)"),
    ("T", "true size of hulls, or as the network sees them"),
    ("S", "saliency: on which pixels the highest Q depends"),
    ("I, M", f"save the picture, the film (to {FOLDER})"),
    ("H", "these keys"),
    ("Q, Esc", "quit"),
)
# Seconds for which a message stays.
MESSAGE_TIME = 4.0
FILM_FRAMES_PER_SECOND = 10


class Session(Screen):
    """Plays a playlist; keys come in by their names, pictures go out to a surface.

    Args:
        playlist: what is shown; the first of it is sailed at once.
        folder: where pictures and films are saved.

    Raises:
        ConfigError: the first policy cannot be sailed.
    """

    def __init__(self, playlist: Playlist, folder: Path = FOLDER) -> None:
        super().__init__(KEYS)
        self.playlist, self.folder = playlist, folder
        self.shows = playlist.shows()
        self.player = Player(self._steps, self.shows[0].telemetry.world.dt)
        self._message, self._message_left = "", 0.0
        self.keys |= {
            "space": self.player.pause,
            "right": self.player.step,
            "left": lambda: self.player.step(-1),
            "up": self.player.faster,
            "down": lambda: self.player.faster(-1),
            "r": self.player.restart,
            "home": self.player.restart,
            "end": lambda: self.player.seek(self._steps),
            "p": lambda: self._go(self.playlist.next_policy),
            "c": lambda: self._go(self.playlist.next_case),
            "e": lambda: self._go(self.playlist.next_episode),
            "s": lambda: self._look(saliency=not self.look.saliency),
        }

    @property
    def _steps(self) -> int:
        return max(show.telemetry.steps for show in self.shows)

    def pressed(self, press: Press, window: Window) -> None:
        """Do what a press in a window stands for; what takes long is said before it begins."""
        super().pressed(press, window)
        if press.key == "m":
            self.draw(window.surface)
            window.present()
            self.save_film(window.surface.get_size())

    def tick(self, seconds: float) -> bool:
        """Let time pass; returns whether the picture has changed."""
        told = bool(self._message)
        self._message_left -= seconds
        if self._message_left <= 0:
            self._message = ""
        running = self.player.running
        self.player.advance(seconds)
        return running or told != bool(self._message)

    def press(self, press: Press, surface: pygame.Surface) -> None:
        """Do what a key or a click stands for; `surface` is what is shown."""
        if press.at is not None:
            step = self.dashboard.step_at(press.at)
            if step is not None:
                self.player.seek(step)
        elif press.key == "i":
            self.save_picture(surface)
        elif press.key == "m":
            self.say("making the film ...")
        else:
            super().press(press, surface)

    @property
    def status(self) -> str:
        """Give the line at the top: a message, or what the player does."""
        player = self.player
        sign = "\N{BLACK RIGHT-POINTING TRIANGLE}" if player.running else "\N{MEDIUM VERTICAL BAR}" * 2
        return self._message or f"{sign}  {player.speed:g}\N{MULTIPLICATION SIGN}    H: keys"

    def say(self, message: str) -> None:
        """Show a message for a while."""
        self._message, self._message_left = message, MESSAGE_TIME

    def save_picture(self, surface: pygame.Surface) -> None:
        """Save what is shown as a PNG, without the list of keys."""
        picture = pygame.Surface(surface.get_size(), depth=32)
        self.dashboard.draw(picture, self.shows, self.player.position, self.look, "")
        step = f"step{int(self.player.position):02d}"
        self._save(step, ".png", lambda path: pygame.image.save(picture, str(path)))

    def save_film(self, size: tuple[int, int]) -> None:
        """Save the whole episode as a GIF, as it is shown now."""

        def write(path: Path) -> None:
            frames = draw_film([self.shows], self.look, size, FILM_FRAMES_PER_SECOND, self.player.speed)
            write_film(path, frames, FILM_FRAMES_PER_SECOND)

        self._save("film", ".gif", write)

    def _save(self, what: str, suffix: str, write: Callable[[Path], None]) -> None:
        """Write a file with a name of its own, and say where it is, or why it is not."""
        words = "-".join(show.title for show in self.shows)
        name = re.sub(r"[^\w]+", "-", f"case{self.playlist.case.name}-{words}").strip("-")[-80:]
        path = self.folder / f"{name}-{what}{suffix}"
        count = 1
        while path.exists():
            count += 1
            path = self.folder / f"{name}-{what}-{count}{suffix}"
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            with replacing(path) as draft:
                write(draft)
            self.say(f"saved {path}")
        except (OSError, pygame.error) as error:
            self.say(f"not saved: {error}")

    def _go(self, there: Callable[[], None]) -> None:
        """Show something else, or stay where that cannot be sailed."""
        playlist = self.playlist
        before = playlist.policy, playlist.case, playlist.episode
        there()
        try:
            self.shows = playlist.shows()
        except ConfigError as error:
            playlist.policy, playlist.case, playlist.episode = before
            self.say(str(error))
            return
        self.player.load(self._steps, self.shows[0].telemetry.world.dt)
