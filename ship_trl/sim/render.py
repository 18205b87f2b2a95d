"""Draw the network's view as 84 x 84 pixels (figure 1): own ship in the middle, heading up.

The background (disc, circles, own ship) never changes, so it is drawn once and copied. For each state, only
the line to the goal and the target ships are drawn, on the few pixels that they can touch. Edges are
anti-aliased: a pixel's coverage is its signed distance to the edge, clamped to one pixel.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import torch
from torch import Tensor
from torchrl.data import Bounded

from ship_trl.config.types import World
from ship_trl.sim import scene
from ship_trl.sim import state as col
from ship_trl.sim.geometry import polygon_edges
from ship_trl.sim.state import goal, is_present, position, relative_positions, target_ships

# Draws states, float [N, S], as uint8 [N, C, 84 * 84].
Drawing = Callable[[Tensor], Tensor]


def polygon_coverage(x: Tensor, y: Tensor, corners: Tensor) -> Tensor:
    """Return the share of each pixel that a convex polygon covers, in [0, 1].

    The share follows from the signed distance of the pixel's centre (x, y) to the nearest edge. All lengths
    are in pixels, in the polygon's frame; `corners` [E, 2] are in counter-clockwise order.
    """
    distance = torch.full_like(x, -math.inf)
    for normal_x, normal_y, offset in polygon_edges(corners):
        distance = torch.maximum(distance, normal_x * x + normal_y * y - offset)
    return (0.5 - distance).clamp_(0.0, 1.0)


class Rasteriser:
    """Draws states as the network sees them; every row of a batch may be another case.

    `rasteriser(state)` takes float [..., S] and returns uint8 [..., C, 84, 84]. C is 3 (RGB) with `colour`,
    else 1 (grey). `drawing` makes what draws of this rasteriser; by default torch does, by `reference`.

    Attributes:
        size: width and height of the picture in pixels.
        channels: C.
        vector_time: time (s) whose way a ship's speed vector shows; 0 draws none.
        background: the picture without line and target ships, uint8 [C, 84, 84].
        outline: corners of a target ship in pixels, counter-clockwise, [E, 2].
        inks: colours of line, target ships and own ship, [3, C].
        vector_scale: length in pixels of a speed vector of 1 m/s; 0 draws none.
        canvas: the picture without line and target ships in floats, [C, 84 * 84].
    """

    def __init__(
        self,
        world: World,
        *,
        colour: bool = False,
        vector_time: float = 0.0,
        device: str | torch.device = "cpu",
        drawing: Callable[[Rasteriser], Drawing] | None = None,
    ) -> None:
        self.size, self.channels = scene.SIZE, 3 if colour else 1
        self.vector_time, self.device = vector_time, torch.device(device)
        # On the CPU, because the corners are read as Python floats.
        outline = torch.tensor(scene.ship_outline(scene.TARGET_LENGTH), device="cpu")
        self.outline = outline * scene.PIXELS_PER_METRE
        self.inks = torch.stack([self._ink(colour) for colour in (scene.LINE, scene.TARGET, scene.OWN)])
        self._patch = torch.arange(scene.patch_size(), device=self.device, dtype=torch.float32)
        self._along = torch.arange(self.size // 2, device=self.device, dtype=torch.float32)
        self._across = torch.arange(4, device=self.device, dtype=torch.float32)
        self.vector_scale = vector_time * scene.PIXELS_PER_METRE
        self.canvas = self._draw_background(world)
        self.background = (self.canvas + 0.5).to(torch.uint8).view(self.channels, self.size, self.size)
        self._draw: Drawing = self.reference if drawing is None else drawing(self)

    def _ink(self, colour: tuple[int, int, int]) -> Tensor:
        """Return an RGB colour as float [C]: the colour itself (C = 3) or its luminance (C = 1)."""
        ink = torch.tensor(colour, dtype=torch.float32, device=self.device)
        if self.channels == 1:
            ink = (ink * torch.tensor(scene.LUMINANCE, device=self.device)).sum(0, keepdim=True)
        return ink

    def spec(self, shape: torch.Size) -> Bounded:
        """Return the TorchRL spec of the pixels for a batch of `shape`: uint8 [*shape, C, 84, 84]."""
        size = (*shape, self.channels, self.size, self.size)
        return Bounded(0, 255, shape=size, dtype=torch.uint8, device=self.device)

    def _draw_background(self, world: World) -> Tensor:
        """Draw the part of the picture that never changes; return float [C, size * size]."""
        axis = torch.arange(self.size, device=self.device) + 0.5 - self.size / 2
        x, y = axis[None, :], -axis[:, None]
        radius = torch.hypot(x, y)
        image = self._ink(scene.OUTSIDE)[:, None, None].expand(-1, self.size, self.size)
        ship = torch.tensor(scene.ship_outline(scene.OWN_LENGTH), device="cpu") * scene.PIXELS_PER_METRE
        for coverage, colour in (
            ((0.5 + scene.VIEW_RADIUS * scene.PIXELS_PER_METRE - radius).clamp(0, 1), scene.DISC),
            ((0.5 + world.goal_distance * scene.PIXELS_PER_METRE - radius).clamp(0, 1), scene.GOAL_CIRCLE),
            ((0.5 + world.safe_distance * scene.PIXELS_PER_METRE - radius).clamp(0, 1), scene.SAFE_CIRCLE),
            # The outline's bow points along +x; in this view own ship's bow points up.
            (polygon_coverage(y + 0 * x, -x + 0 * y, ship), scene.OWN),
        ):
            image = image + coverage * (self._ink(colour)[:, None, None] - image)
        return image.reshape(self.channels, -1)

    def __call__(self, state: Tensor) -> Tensor:
        """Draw states, float [..., S]; return uint8 [..., C, 84, 84].

        Raises:
            ValueError: if compiled, a state is not finite, or larger than `fast.draw.MAX_STATE_SUM`.
        """
        flat = state.reshape(-1, state.shape[-1])
        return self._draw(flat).reshape(*state.shape[:-1], self.channels, self.size, self.size)

    def reference(self, flat: Tensor) -> Tensor:
        """Draw states in torch, on any device: float [N, S] to uint8 [N, C, 84 * 84]."""
        image = self.canvas.expand(flat.shape[0], -1, -1).clone()
        turn = math.pi / 2 - flat[:, col.HEADING]
        # Rotate so that the heading points up, and scale metres to pixels.
        rotate_x = torch.cos(turn) * scene.PIXELS_PER_METRE
        rotate_y = torch.sin(turn) * scene.PIXELS_PER_METRE
        self._draw_line(image, goal(flat) - position(flat), rotate_x, rotate_y)
        if self.vector_scale:
            self._draw_vectors(image, flat, rotate_x[:, None], rotate_y[:, None], turn)
        if target_ships(flat).shape[1]:
            self._draw_ships(image, flat, rotate_x[:, None], rotate_y[:, None], turn)
        return image.add_(0.5).to(torch.uint8)

    def _draw_line(self, image: Tensor, to_goal: Tensor, rotate_x: Tensor, rotate_y: Tensor) -> None:
        """Blend the line to the goal over `image` float [N, C, P]; its length is the distance (section 3.1).

        `to_goal` [N, 2] is relative to own ship, in metres. `rotate_x` and `rotate_y` [N] are cosine and sine
        of the rotation to heading up, times pixels per metre.
        """
        dx = to_goal[:, 0] * rotate_x - to_goal[:, 1] * rotate_y
        dy = -(to_goal[:, 0] * rotate_y + to_goal[:, 1] * rotate_x)
        # At the goal the line has no direction; draw a very short one.
        at_goal = dx * dx + dy * dy < 1e-12
        dx, dy = dx.masked_fill(at_goal, 1e-6), dy.masked_fill(at_goal, 0.0)
        length = torch.hypot(dx, dy)
        ux, uy = dx / length, dy / length
        # A strip along the longer axis holds the line: one row of four pixels for each pixel along the axis.
        steep = dy.abs() > dx.abs()
        major, minor = torch.where(steep, uy, ux), torch.where(steep, ux, uy)
        ahead = major >= 0
        half = self.size // 2
        column = torch.where(ahead[:, None], half + self._along, half - 1 - self._along)
        along = column + (0.5 - half)
        first = (along * (minor / major)[:, None] + (half - 1.5)).round_().clamp_(0, self.size - 4)
        row = first[:, :, None] + self._across
        across = row + (0.5 - half)
        along = along[:, :, None]
        on_axis = along * major[:, None, None] + across * minor[:, None, None]
        off_axis = along * minor[:, None, None] - across * major[:, None, None]
        beyond_end = (on_axis - length[:, None, None]).clamp_(min=0.0)
        distance = torch.sqrt(off_axis * off_axis + beyond_end * beyond_end)
        coverage = (0.5 + scene.LINE_WIDTH / 2 - distance).clamp_(0.0, 1.0)
        column = column[:, :, None]
        index = torch.where(steep[:, None, None], column * self.size + row, row * self.size + column)
        self._blend(image, index, coverage, self.inks[0])

    def _draw_vectors(
        self, image: Tensor, state: Tensor, rotate_x: Tensor, rotate_y: Tensor, turn: Tensor
    ) -> None:
        """Blend the speed vectors of own ship and target ships over `image`; arguments as `_draw_ships`.

        A vector is the way of a ship's bow in `vector_time`, if the ship holds course and speed.
        """
        cx, cy = self._places(relative_positions(state), rotate_x, rotate_y)
        heading = target_ships(state)[..., col.SHIP_HEADING] + turn[:, None]
        speed = target_ships(state)[..., col.SHIP_SPEED] * is_present(state)
        half, ahead = torch.full_like(turn, self.size / 2), torch.full_like(turn, math.pi / 2)
        self._draw_vector(image, (half, half), ahead, state[:, col.SPEED], scene.OWN_LENGTH, self.inks[2])
        for k in range(cx.shape[1]):
            middle, ink = (cx[:, k], cy[:, k]), self.inks[1]
            self._draw_vector(image, middle, heading[:, k], speed[:, k], scene.TARGET_LENGTH, ink)

    def _draw_vector(
        self,
        image: Tensor,
        middle: tuple[Tensor, Tensor],
        heading: Tensor,
        speed: Tensor,
        hull: float,
        ink: Tensor,
    ) -> None:
        """Blend a line from each ship's bow over `image`; the whole picture is computed, for simplicity.

        Shapes: middle of the ship in pixels from the left and upper edges, heading (rad) counter-clockwise
        from the right, speed (m/s), all [N]; hull is the ship's length (m).
        """
        axis = torch.arange(self.size, device=self.device) + 0.5
        x, y = axis - middle[0][:, None, None], middle[1][:, None, None] - axis[:, None]
        cos, sin = torch.cos(heading)[:, None, None], torch.sin(heading)[:, None, None]
        length = speed[:, None, None] * self.vector_scale
        on_axis, off_axis = x * cos + y * sin - hull / 2 * scene.PIXELS_PER_METRE, y * cos - x * sin
        beyond_end = on_axis - torch.minimum(on_axis.clamp(min=0.0), length)
        distance = torch.hypot(beyond_end, off_axis)
        coverage = (0.5 + scene.LINE_WIDTH / 2 - distance).clamp_(0.0, 1.0) * (length > 0)
        image += coverage.flatten(1)[:, None] * (ink[:, None] - image)

    def _places(self, away: Tensor, rotate_x: Tensor, rotate_y: Tensor) -> tuple[Tensor, Tensor]:
        """Return pixels from the left and upper edges, [N, K] each, of places relative to own ship (m)."""
        half = self.size / 2
        right = away[..., 0] * rotate_x - away[..., 1] * rotate_y + half
        return right, half - (away[..., 0] * rotate_y + away[..., 1] * rotate_x)

    def _draw_ships(
        self, image: Tensor, state: Tensor, rotate_x: Tensor, rotate_y: Tensor, turn: Tensor
    ) -> None:
        """Blend the target ships over `image` float [N, C, P] as green polygons.

        The states are [N, S]. `turn` [N] is the rotation to heading up in
        radians; `rotate_x` and `rotate_y` [N, 1] are its cosine and sine, times pixels per metre.
        In figure 2 a ship's direction is theta_1 + 90 deg, its heading theta_1 + theta_3 + 90 deg.
        """
        cx, cy = self._places(relative_positions(state), rotate_x, rotate_y)
        heading = target_ships(state)[..., col.SHIP_HEADING] + turn[:, None]
        # Patches are moved back inside the picture. This does not change the coverage of a pixel.
        last = self.size - len(self._patch)
        left = (cx - len(self._patch) / 2).round_().clamp_(0, last)
        top = (cy - len(self._patch) / 2).round_().clamp_(0, last)
        column = left[..., None] + self._patch
        row = top[..., None] + self._patch
        x = (column + 0.5 - cx[..., None])[..., None, :]
        y = (cy[..., None] - row - 0.5)[..., :, None]
        cos, sin = torch.cos(heading)[..., None, None], torch.sin(heading)[..., None, None]
        coverage = polygon_coverage(x * cos + y * sin, y * cos - x * sin, self.outline)
        coverage = coverage * is_present(state)[..., None, None]
        index = row[..., :, None] * self.size + column[..., None, :]
        for k in range(cx.shape[1]):
            self._blend(image, index[:, k], coverage[:, k], self.inks[1])

    def _blend(self, image: Tensor, index: Tensor, coverage: Tensor, ink: Tensor) -> None:
        """Blend `ink` [C] over `image` [N, C, P]; pixel `index` and `coverage` are [N, ...]."""
        where = index.flatten(1).long()[:, None].expand(-1, self.channels, -1)
        under = image.gather(2, where)
        image.scatter_(2, where, under + coverage.flatten(1)[:, None] * (ink[:, None] - under))
