"""Gradient, occlusion and erased things show which pixels the greedy action depends on."""

import torch

from ship_trl.explain.saliency import (
    PATCH,
    advantage,
    erase_things,
    gradient,
    greedy_actions,
    occlusion,
)
from tests.explain.worlds import a_network, env_of, some_states


def test_only_the_pixels_of_a_thing_change() -> None:
    states, background = some_states().states[::20], env_of().rasteriser.background
    pixels = env_of().rasteriser(states)
    line, *ships, all_ships = erase_things(env_of(), states)
    assert [one.thing for one in (line, *ships, all_ships)] == [
        *("the line to the goal", "ship 1", "ship 2", "all ships")
    ]
    for one in (line, *ships, all_ships):
        changed = (one.pixels != pixels).any(1)
        assert not bool((changed & ~one.mask).any())
        assert bool(changed[one.visible].flatten(1).any(1).all())
    # Without line and ships the centre shows the background.
    empty = torch.where(line.mask[:, None], background, all_ships.pixels)[..., 42:44, 41:43]
    assert torch.equal(empty, background[:, 42:44, 41:43].expand_as(empty))


def test_the_gradient_is_the_slope_of_the_advantage() -> None:
    network, pixels = a_network(), some_states().pixels[:2]
    found = gradient(network, pixels)
    action, step = greedy_actions(network, pixels), 8.0
    row, column = divmod(int(found[0].argmax()), 84)
    up, down = pixels.float(), pixels.float()
    up[0, 0, row, column] += step
    down[0, 0, row, column] -= step
    with torch.no_grad():
        slope = (advantage(network, up, action) - advantage(network, down, action))[0] / (2 * step)
    assert found.shape == (2, 84, 84) and bool((found >= 0).all())
    torch.testing.assert_close(found[0, row, column], 255 * slope.abs(), rtol=0.1, atol=1e-3)


def test_occlusion_is_the_drop_with_a_square_hidden() -> None:
    network, picture, background = a_network(), some_states().pixels[7], env_of().rasteriser.background
    drop, half = occlusion(network, picture, background), PATCH // 2
    drawn = (picture != background).any(0).float()[None]
    near = torch.nn.functional.max_pool2d(drawn, PATCH, 1, half)[0] > 0
    assert bool((drop[~near] == 0).all()) and bool((drop[near] != 0).any())
    assert bool((occlusion(network, background, background) == 0).all())
    row, column = divmod(int(drop.abs().argmax()), 84)
    hidden = picture.clone()
    rows = slice(max(0, row - half), row + half + 1)
    columns = slice(max(0, column - half), column + half + 1)
    hidden[:, rows, columns] = background[:, rows, columns]
    action = greedy_actions(network, picture[None])
    with torch.no_grad():
        known = advantage(network, picture[None], action) - advantage(network, hidden[None], action)
    torch.testing.assert_close(drop[row, column], known[0], rtol=1e-3, atol=1e-5)
