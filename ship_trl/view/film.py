"""An episode as an animated GIF: the large picture, and beside it what the agent chose and why."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray
from PIL import Image

from ship_trl.config.types import World
from ship_trl.files.disk import replacing
from ship_trl.learn.rollout import Episode
from ship_trl.sim import scene
from ship_trl.sim.cases import Case
from ship_trl.sim.render import Rasteriser
from ship_trl.view.draw import draw_scene, to_array
from ship_trl.view.legend import draw_legend
from ship_trl.view.lettering import BAR, CHOSEN, FAINT, INK, OUTCOMES, PAPER, RULE
from ship_trl.view.panel import HEIGHT, WIDTH, Panel

# Milliseconds; GIF counts hundredths of a second.
STEP_TIME = 100
LAST_TIME = 2000
COLOURS = 128
SCENE = (
    *(scene.OUTSIDE, scene.DISC, scene.GOAL_CIRCLE, scene.SAFE_CIRCLE),
    *(scene.OWN, scene.LINE, scene.TARGET),
)
# The network's greys of the same things, and a ramp for the shades between them.
GREYS = tuple((round(float(np.dot(colour, scene.LUMINANCE))),) * 3 for colour in SCENE)
RAMP = tuple((level,) * 3 for level in range(8, 256, 8))
EXACT = (*SCENE, *GREYS, *RAMP, PAPER, INK, FAINT, RULE, BAR, CHOSEN, *OUTCOMES.values())


def write_gif(
    path: Path | str, case: Case, world: World, episode: Episode, rasteriser: Rasteriser, title: str = ""
) -> None:
    """Write an episode of T steps as a GIF of T + 1 frames, which runs for ever.

    Args:
        path: where it goes; written beside and renamed.
        case: where it was sailed.
        world: its physics.
        episode: what was sailed, T >= 1; its Q-values are in units of the learner's scaled return.
        rasteriser: draws what the network saw, in grey or colour, on any device.
        title: one line for the panel.

    Raises:
        OSError: the file cannot be written.
    """
    frames = draw_frames(case, world, episode, rasteriser, title)
    palette = shared_palette(frames)
    indexed = [frame.quantize(palette=palette, dither=Image.Dither.NONE) for frame in frames]
    times = [STEP_TIME] * episode.length + [LAST_TIME]
    with replacing(Path(path)) as draft:
        # By way of memory: Pillow's own writing says of a full disk no more than "encoder error -2".
        film = io.BytesIO()
        indexed[0].save(film, "GIF", save_all=True, append_images=indexed[1:], duration=times, loop=0)
        draft.write_bytes(film.getvalue())


def draw_frames(
    case: Case, world: World, episode: Episode, rasteriser: Rasteriser, title: str = ""
) -> list[Image.Image]:
    """Draw the frames in RGB, one for each state of the episode."""
    panel = Panel(case, world, episode, title)
    seen = _views(rasteriser, episode)
    below = draw_legend(HEIGHT + WIDTH, HEIGHT, world)
    frames = []
    for step, state in enumerate(episode.states):
        frame = Image.new("RGB", (HEIGHT + WIDTH, HEIGHT + below.height))
        frame.paste(below, (0, HEIGHT))
        picture = draw_scene(case, world, state, HEIGHT, episode.states[:step])
        frame.paste(Image.fromarray(to_array(picture)), (0, 0))
        frame.paste(panel(step, seen[step]), (HEIGHT, 0))
        frames.append(frame)
    return frames


def shared_palette(frames: list[Image.Image]) -> Image.Image:
    """One palette for all frames, so that what stands still keeps its colour and costs no bytes.

    The colours of scene and panel are in it as they are; the shades between them are read off the
    first, middle and last frame, which hold every kind of thing drawn.
    """
    chosen = [frames[0], frames[len(frames) // 2], frames[-1]]
    width, height = frames[0].size
    sheet = Image.new("RGB", (width, height * len(chosen)))
    for k, frame in enumerate(chosen):
        sheet.paste(frame, (0, k * height))
    # Median cut gives colours by area and would lose the small bright things to shades of water.
    shades = sheet.quantize(COLOURS - len(EXACT), method=Image.Quantize.MAXCOVERAGE).getpalette() or []
    palette = Image.new("P", (1, 1))
    palette.putpalette([value for colour in EXACT for value in colour] + shades)
    return palette


def _views(rasteriser: Rasteriser, episode: Episode) -> NDArray[np.uint8]:
    with torch.no_grad():
        return rasteriser(episode.states.to(rasteriser.device)).cpu().numpy()
