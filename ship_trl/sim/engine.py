"""What steps, draws and begins the episodes of a world: torch and Python alone, or something faster."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from ship_trl.sim.render import Drawing, Rasteriser
from ship_trl.sim.traffic import draw_scenes
from ship_trl.sim.transition import Step, Transition


@dataclass(frozen=True)
class Engine:
    """Makes what computes a world. `ship_trl.fast` has a faster one, which may round differently.

    Attributes:
        step: makes the step of a transition.
        drawing: makes the drawing of a rasteriser.
        scenes: draws random encounters, see `traffic.draw_scenes`.
    """

    step: Callable[[Transition], Step] = lambda transition: transition
    drawing: Callable[[Rasteriser], Drawing] = lambda rasteriser: rasteriser.reference
    scenes: Callable[..., bool] = draw_scenes


TORCH = Engine()
