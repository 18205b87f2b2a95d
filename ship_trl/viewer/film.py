"""What a window would show, as GIF, MP4 or PNG frames; no screen is needed."""

from __future__ import annotations

import io
import math
import shutil
from collections.abc import Iterator, Sequence
from itertools import chain, islice
from pathlib import Path
from typing import Any

import pygame
from PIL import Image

from ship_trl.config.errors import ConfigError
from ship_trl.files.disk import replacing
from ship_trl.view.film import shared_palette
from ship_trl.viewer.dashboard import Dashboard, Look
from ship_trl.viewer.show import Show

# Seconds for which the last picture of an episode stays.
LAST = 2.0
# Frames by whose colours a GIF is coloured: in the first ones all lines of the graphs are there already.
LOOKED_AT = 20


def draw_film(
    acts: Sequence[Sequence[Show]], look: Look, size: tuple[int, int], frames_per_second: float, speed: float
) -> Iterator[pygame.Surface]:
    """Draw the frames of a film; each is another surface.

    Args:
        acts: one after the other, each of one episode or two beside each other.
        look: how they are shown.
        size: width and height in pixels.
        frames_per_second: of the film.
        speed: seconds of the world in one of the film.
    """
    dashboard = Dashboard()
    for shows in acts:
        steps = max(show.telemetry.steps for show in shows)
        advance = speed / frames_per_second / shows[0].telemetry.world.dt
        moving = math.ceil(steps / advance)
        for frame in range(moving + max(1, round(LAST * frames_per_second))):
            surface = pygame.Surface(size, depth=32)
            dashboard.draw(surface, shows, min(frame * advance, float(steps)), look)
            yield surface


def write_film(path: Path, frames: Iterator[pygame.Surface], frames_per_second: float) -> None:
    """Write a GIF or an MP4 as the name ends, or PNG frames into a folder of any other name.

    Raises:
        ConfigError: an MP4, and imageio-ffmpeg is not there.
        OSError: it cannot be written.
    """
    if path.suffix == ".gif":
        write_gif(path, frames, frames_per_second)
    elif path.suffix == ".mp4":
        write_mp4(path, frames, frames_per_second)
    else:
        write_frames(path, frames)


def write_gif(path: Path, frames: Iterator[pygame.Surface], frames_per_second: float) -> None:
    """Write a GIF that runs for ever, in 128 colours that all frames share."""
    kept = [picture(frame) for frame in islice(frames, LOOKED_AT)]
    palette = shared_palette(kept)
    indexed = (
        frame.quantize(palette=palette, dither=Image.Dither.NONE)
        for frame in chain(kept, map(picture, frames))
    )
    time = round(1000 / frames_per_second)
    with replacing(path) as draft:
        # By way of memory: Pillow's own writing says of a full disk no more than "encoder error -2".
        film = io.BytesIO()
        next(indexed).save(film, "GIF", save_all=True, append_images=indexed, duration=time, loop=0)
        draft.write_bytes(film.getvalue())


def write_mp4(path: Path, frames: Iterator[pygame.Surface], frames_per_second: float) -> None:
    """Write an MP4 that every player knows (H.264, yuv420p); width and height must be even."""
    ffmpeg = need_ffmpeg()
    first = next(frames)
    with replacing(path) as draft:
        writer = ffmpeg.write_frames(
            str(draft),
            first.get_size(),
            fps=frames_per_second,
            macro_block_size=2,
            quality=7,
            ffmpeg_log_level="error",
            output_params=["-movflags", "+faststart"],
        )
        writer.send(None)
        for frame in chain([first], frames):
            writer.send(pygame.image.tobytes(frame, "RGB"))
        writer.close()


def need_ffmpeg() -> Any:
    """Import imageio-ffmpeg.

    Raises:
        ConfigError: it is not installed.
    """
    try:
        import imageio_ffmpeg
    except ImportError:
        raise ConfigError(
            "--output: an MP4 needs imageio-ffmpeg (pip install imageio-ffmpeg, or the extra `film`); "
            "a name that ends with .gif does not"
        ) from None
    return imageio_ffmpeg


def write_frames(folder: Path, frames: Iterator[pygame.Surface]) -> None:
    """Write PNGs, numbered from 00000.png on, into a folder that is new or empty; all of them or none."""
    draft = folder.with_name(f".{folder.name}.part")
    shutil.rmtree(draft, ignore_errors=True)
    draft.mkdir(parents=True)
    try:
        for number, frame in enumerate(frames):
            pygame.image.save(frame, str(draft / f"{number:05d}.png"))
        draft.replace(folder)
    finally:
        shutil.rmtree(draft, ignore_errors=True)


def picture(surface: pygame.Surface) -> Image.Image:
    """Copy a surface to an image."""
    return Image.frombytes("RGB", surface.get_size(), pygame.image.tobytes(surface, "RGB"))
