"""Watching a playlist in a window: its keys, and the pictures and films that are saved."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import pygame

from ship_trl.config.errors import ConfigError
from ship_trl.files.disk import atomic_write
from ship_trl.view import pen
from ship_trl.view.dashboard import draw_dashboard
from ship_trl.view.film import draw_film, write_film
from ship_trl.view.window.interactive import DOWN, LEFT, RIGHT, UP, Interactive
from ship_trl.view.window.player import Player
from ship_trl.view.window.playlist import Playlist

FOLDER = Path("outputs/watch")
# Seconds for which a message stays.
MESSAGE_TIME = 4.0
FILM_FRAMES_PER_SECOND = 10


class Session(Interactive):
    """Plays a playlist; pictures and films are saved in a folder.

    Raises:
        ConfigError: the first policy cannot be loaded.
    """

    def __init__(self, playlist: Playlist, folder: Path = FOLDER) -> None:
        super().__init__()
        self.playlist, self.folder = playlist, folder
        self.views = playlist.views()
        self.player = player = Player(self._steps, self.views[0].telemetry.world.dt)
        self._message, self._message_left = "", 0.0
        faster, slower = (lambda: player.change_speed(1)), (lambda: player.change_speed(-1))
        back, to_end = (lambda: player.step(-1)), (lambda: player.seek(self._steps))
        policy, case = (lambda: self._go(playlist.next_policy)), (lambda: self._go(playlist.next_case))
        saving = {"i": self.save_picture, "m": self.save_film}
        self.bindings[:0] = [
            ("Space", "pause, go on; at the end, once more", {"space": player.pause}),
            (f"{LEFT} {RIGHT}", "a step back, a step on", {"left": back, "right": player.step}),
            (f"{UP} {DOWN}", "faster, slower", {"up": faster, "down": slower}),
            ("R, End", "restart, to the end", {"r": player.restart, "home": player.restart, "end": to_end}),
            ("Click", "in a graph: to that step", {}),
            ("P, C", "next policy, next case", {"p": policy, "c": case}),
            ("E", "next episode: other draws", {"e": lambda: self._go(playlist.next_episode)}),
            ("S", "saliency: on which pixels the highest Q depends", {"s": self.look_key("saliency")}),
            ("I, M", f"save the picture, the film (to {FOLDER})", saving),
        ]

    @property
    def _steps(self) -> int:
        return max(view.telemetry.steps for view in self.views)

    @property
    def status(self) -> str:
        """The line at the top: a message, or what the player does."""
        player = self.player
        sign = "\N{BLACK RIGHT-POINTING TRIANGLE}" if player.running else "\N{MEDIUM VERTICAL BAR}" * 2
        return self._message or f"{sign}  {player.speed:g}\N{MULTIPLICATION SIGN}    H: keys"

    def tick(self, seconds: float) -> bool:
        """Let time pass; return whether the picture has changed."""
        had_message = bool(self._message)
        self._message_left -= seconds
        if self._message_left <= 0:
            self._message = ""
        was_running = self.player.running
        self.player.advance(seconds)
        return was_running or had_message != bool(self._message)

    def show_message(self, message: str) -> None:
        """Show a message for a while."""
        self._message, self._message_left = message, MESSAGE_TIME

    def save_picture(self) -> None:
        """Save what is shown as a PNG, without the help."""
        picture = pen.new_surface(*pygame.display.get_window_size())
        draw_dashboard(picture, self.views, self.player.position, self.look)
        step = f"step{int(self.player.position):02d}"
        self._save(step, ".png", lambda path: pygame.image.save(picture, str(path)))

    def save_film(self) -> None:
        """Save the whole episode as a GIF, as it is shown now; that takes a while."""
        self.show_message("making the film ...")
        self.show()
        size = pygame.display.get_window_size()
        frames = draw_film([self.views], self.look, size, FILM_FRAMES_PER_SECOND, self.player.speed)
        self._save("film", ".gif", lambda path: write_film(path, frames, FILM_FRAMES_PER_SECOND))

    def _save(self, what: str, suffix: str, write: Callable[[Path], None]) -> None:
        """Write a file under a new name, and show where it is, or why there is none."""
        titles = "-".join(view.title for view in self.views)
        name = re.sub(r"[^\w]+", "-", f"case{self.playlist.case.name}-{titles}").strip("-")[-80:]
        path, count = self.folder / f"{name}-{what}{suffix}", 1
        while path.exists():
            count += 1
            path = self.folder / f"{name}-{what}-{count}{suffix}"
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            with atomic_write(path) as draft:
                write(draft)
            self.show_message(f"saved {path}")
        except (OSError, pygame.error) as error:
            self.show_message(f"not saved: {error}")

    def _go(self, there: Callable[[], None]) -> None:
        """Show something else, or stay where that cannot be loaded."""
        playlist = self.playlist
        before = playlist.policy, playlist.case, playlist.episode
        there()
        try:
            self.views = playlist.views()
        except ConfigError as error:
            playlist.policy, playlist.case, playlist.episode = before
            self.show_message(str(error))
            return
        self.player.load(self._steps, self.views[0].telemetry.world.dt)
