"""What programs write into configurations: worlds, networks, settings of the learner."""

from __future__ import annotations

from typing import Any

from hypothesis import strategies as st

from ship_trl.config.types import plain
from ship_trl.sim.cases import load_world
from tests.fuzz.trees import damaged
from tests.fuzz.values import any_float, any_int, magnitude, mostly

WORLD = plain(load_world())


@st.composite
def worlds(draw: st.DrawFn) -> dict[str, Any]:
    """A world of any size, some beyond what numbers can hold."""
    wide = st.one_of(magnitude(1e-4, 1e4), magnitude(1e-4, 1e4), magnitude(1e-40, 1e40), any_float)
    near = magnitude(0.3, 3)
    speed, turn = st.floats(-30, 30), st.floats(-1, 1)
    odd = st.tuples(st.one_of(speed, wide), st.one_of(turn, wide))
    action = mostly(st.tuples(speed, turn), odd, 60).map(list)
    world = WORLD | {
        "dt": draw(mostly(near, wide)),
        "max_steps": draw(mostly(st.integers(60, 300), st.one_of(st.integers(-2, 1200), any_int))),
        "safe_distance": draw(mostly(near.map(lambda x: x * 45), wide)),
        "goal_distance": draw(mostly(near.map(lambda x: x * 60), wide)),
        "actions": draw(
            mostly(
                st.one_of(st.just(WORLD["actions"]), st.lists(action, min_size=1, max_size=12)),
                st.integers(1, 300).map(lambda n: [[15.0, 0.0]] * n),
            )
        ),
        "reward": {key: draw(mostly(st.just(value), wide, 60)) for key, value in WORLD["reward"].items()},
    }
    return draw(mostly(st.just(world), damaged(world), 4))


@st.composite
def networks(draw: st.DrawFn) -> dict[str, Any]:
    """Layers that fit on one another, most of them small, or not."""
    side, conv = 84, []
    sizes = mostly(st.integers(1, 12), st.sampled_from([200, 4096, 5000, 10**9]), 20)
    for _ in range(draw(mostly(st.integers(0, 4), st.sampled_from([40, 400]), 20))):
        kernel = draw(st.integers(1, min(side, 12)))
        stride = draw(st.integers(1, 5))
        conv.append([draw(sizes), kernel, stride])
        side = (side - kernel) // stride + 1
    conv.append([draw(sizes), side, 1])
    network = {"conv": conv, "hidden": draw(sizes)}
    return draw(mostly(st.just(network), damaged(network), 4))


any_big = mostly(
    st.one_of(st.integers(1, 1000), magnitude(1, 1e7).map(int)),
    st.one_of(any_int, magnitude(1, 1e13).map(int)),
    6,
)
# Settings of the learner that decide how much a run holds in memory, and how large its numbers grow.
SIZES = dict.fromkeys(
    (
        *("episodes", "num_envs", "batch_size", "replay_size", "warmup_steps", "update_every"),
        *("evaluate_every", "jumpstart_draws"),
    ),
    any_big,
)
RATES = {
    key: mostly(magnitude(1e-6, 1.0), any_float, 6)
    for key in (
        *("gamma", "lr", "lr_end", "tau", "huber_delta", "reward_scale"),
        *("epsilon_start", "epsilon_end", "epsilon_fraction"),
    )
}
WORDED = {
    "loss": st.sampled_from(["l2", "huber", "l3"]),
    "backend": st.sampled_from(["auto", "incremental", "dense"]),
}


@st.composite
def learners(draw: st.DrawFn) -> dict[str, Any]:
    """One to four settings of the learner."""
    known = SIZES | RATES | WORDED
    chosen = draw(st.lists(st.sampled_from(sorted(known)), min_size=1, max_size=4, unique=True))
    return {key: draw(known[key]) for key in chosen}
