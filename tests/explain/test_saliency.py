"""Gradient, occlusion and erased things say what moves the chosen action."""

import dataclasses

import torch

from ship_trl.explain.saliency import PATCH, advantage, choose, gradient, moved, occlusion, things
from ship_trl.sim.cases import load_world
from ship_trl.sim.render import Rasteriser
from tests.explain.worlds import a_network, case_of, some_states


def test_things_are_what_differs_from_the_sea() -> None:
    world, states = load_world(), some_states().states[::20]
    draw = Rasteriser(case_of(), world)
    whole = draw(states)
    erased = things(case_of(), world, draw, states)
    assert [one.thing for one in erased] == ["the line to the goal", "ship 1", "ship 2", "all ships"]
    for one in erased:
        changed = (one.pixels != whole).any(1)
        assert torch.equal(changed & ~one.where, torch.zeros_like(changed))
        assert bool(changed[one.seen].flatten(1).any(1).all())
    every = torch.where(erased[0].where[:, None], draw.background, erased[3].pixels)
    assert torch.equal(
        every[..., 42:44, 41:43], draw.background[:, 42:44, 41:43].expand_as(every[..., 42:44, 41:43])
    )
    alone = Rasteriser(dataclasses.replace(case_of(), target_ships=[]), world)(states)
    assert torch.equal(erased[3].pixels, alone)


def test_the_gradient_is_that_of_the_advantage() -> None:
    network, pixels = a_network(), some_states().pixels[:2]
    found = gradient(network, pixels)
    action, step = choose(network, pixels), 8.0
    where = divmod(int(found[0].argmax()), 84)
    up, down = pixels.float(), pixels.float()
    up[0, 0, where[0], where[1]] += step
    down[0, 0, where[0], where[1]] -= step
    with torch.no_grad():
        slope = (advantage(network, up, action) - advantage(network, down, action))[0] / (2 * step)
    assert found.shape == (2, 84, 84) and bool((found >= 0).all())
    torch.testing.assert_close(found[0][where], 255 * slope.abs(), rtol=0.1, atol=1e-3)


def test_occlusion_is_zero_where_nothing_is_drawn() -> None:
    world = load_world()
    draw, network = Rasteriser(case_of(), world), a_network()
    picture = some_states().pixels[7]
    fall = occlusion(network, picture, draw.background)
    near = torch.nn.functional.max_pool2d(
        (picture != draw.background).any(0).float()[None], PATCH, 1, PATCH // 2
    )[0]
    assert bool((fall[near == 0] == 0).all()) and bool((fall[near > 0] != 0).any())
    assert bool((occlusion(network, draw.background, draw.background) == 0).all())


def test_a_square_hidden_is_what_occlusion_measures() -> None:
    draw, network = Rasteriser(case_of(), load_world()), a_network()
    picture = some_states().pixels[7]
    fall = occlusion(network, picture, draw.background)
    row, column = divmod(int(fall.abs().argmax()), 84)
    hidden, half = picture.clone(), PATCH // 2
    rows = slice(max(0, row - half), row + half + 1)
    columns = slice(max(0, column - half), column + half + 1)
    hidden[:, rows, columns] = draw.background[:, rows, columns]
    action = choose(network, picture[None])
    with torch.no_grad():
        known = advantage(network, picture[None], action) - advantage(network, hidden[None], action)
    torch.testing.assert_close(fall[row, column], known[0], rtol=1e-3, atol=1e-5)


def test_pictures_that_stay_move_nothing() -> None:
    network, pixels = a_network(), some_states().pixels[:40]
    assert moved(network, pixels, pixels) == 0
    shuffled = pixels[torch.randperm(40, generator=torch.Generator().manual_seed(0))]
    # Any picture for any other: the difference of two draws varies by the square root of two.
    assert 1.0 < moved(network, pixels, shuffled) < 1.7
