"""How large a run may be: beyond these it would not fit into memory, or its numbers into 32 bits. No torch.

They are far above what a run needs, and stop a slip of the keyboard before the machine swaps.
"""

from __future__ import annotations

from typing import TypeVar

from ship_trl.config.errors import ConfigError
from ship_trl.config.network import Geometry, cut_by_words, linear_from
from ship_trl.config.types import PICTURE, BackendName, Config, Learn, World

# With so many the planner's table of returns to come takes 2.3 GB at most.
MAX_STEPS = 1000
# The planner tries each action at each step: with ten a thousand steps take it about ten minutes.
MAX_ACTIONS, MAX_TRIED = 100, 10_000
# Seconds a step.
SHORTEST, LONGEST = 1e-3, 1e3
# Metres that the fastest action makes: a step, which must be more than what rounding changes, and an episode,
# after which 32-bit numbers tell decimetres. Radians that an episode turns by, told to a thousandth.
SMALLEST_STEP, FARTHEST, TURNED = 1e-3, 1e6, 1e4
# Metres of a circle; a case's places reach as far.
WIDEST = 1e5
# Of a reward's constants.
DEAREST = 1e6
# A step's reward as the learner gets it: returns of a thousand of them can be squared.
SCALED = 1e9
# Of a learning rate (Adam's steps are about that large), of a reward's scale, and of Huber's threshold.
FASTEST_RATE, LARGEST_SCALE, LARGEST_DELTA = 1.0, 1e3, 1e9
# Episodes and steps, which only take time: a run of a billion would take years.
LONGEST_COUNT = 10**9
MOST_DRAWS = 10**6
# Bytes of the replay, which a machine must hold at once: a state and what came of it take 60.
REPLAY_BYTES, STATE_BYTES = 2**33, 60
# Numbers of the conv layers' maps that are held at once, 4 GB: of a batch, and of the ships that sail.
MOST_NUMBERS = 1_000_000_000
# With Adam's two means, the gradient and the target network five times as many numbers are held, 2 GB.
MOST_WEIGHTS = 100_000_000

Number = TypeVar("Number", int, float)


def at_most(most: Number, key: str, value: Number, why: str = "") -> None:
    """Raise a `ConfigError` where a value is above the `most`."""
    if value > most:
        number = str(most) if isinstance(most, int) else f"{most:g}"
        raise ConfigError(f"{key}: must be at most {number}{why and f' ({why})'}, got {value}")


def check_sizes(world: World) -> None:
    """Check how far and how long an episode may lead.

    Raises:
        ConfigError: naming the key and what is allowed.
    """
    at_most(MAX_STEPS, "world.max_steps", world.max_steps, "the planner's memory grows with its square")
    if not SHORTEST <= world.dt <= LONGEST:
        raise ConfigError(f"world.dt: must be from {SHORTEST:g} to {LONGEST:g} (seconds), got {world.dt}")
    count = len(world.actions)
    at_most(
        min(MAX_ACTIONS, MAX_TRIED // world.max_steps),
        "world.actions",
        count,
        "their number; the planner tries all",
    )
    fastest = max(abs(speed) for speed, _ in world.actions) * world.dt
    turned = max(abs(turn) for _, turn in world.actions) * world.dt * world.max_steps
    if max(speed for speed, _ in world.actions) * world.dt < SMALLEST_STEP:
        raise ConfigError(
            f"world.actions: must make at least {SMALLEST_STEP:g} m in a step of world.dt={world.dt:g} s"
        )
    sailed = fastest * world.max_steps
    if sailed > FARTHEST:
        raise ConfigError(f"world.actions: must make at most {FARTHEST:g} m in an episode, got {sailed:g}")
    if turned > TURNED:
        raise ConfigError(f"world.actions: must turn by at most {TURNED:g} rad in an episode, got {turned:g}")
    at_most(WIDEST, "world.safe_distance", world.safe_distance, "metres")
    reach = min(WIDEST, sailed)
    at_most(
        reach,
        "world.goal_distance",
        world.goal_distance,
        "metres that the fastest action makes in an episode",
    )
    for key, value in vars(world.reward).items():
        if not abs(value) <= DEAREST:
            raise ConfigError(
                f"world.reward.{key}: must be a finite number of at most {DEAREST:g} in size, got {value}"
            )


def largest_reward(world: World) -> float:
    """Bound what a step of the paper's reward may cost or pay."""
    reward, fastest = world.reward, max(abs(speed) for speed, _ in world.actions)
    farthest = world.goal_distance + 2 * fastest * world.dt * world.max_steps
    shaping = abs(reward.w3 * reward.k1) * farthest + abs(reward.w4 * reward.k2) * 180
    return abs(reward.w1 * reward.goal) + abs(reward.w2 * reward.collision) + shaping


def check_learn(learn: Learn, world: World) -> None:
    """Check what of the learner costs time alone, and how large its numbers may grow."""
    for key in ("episodes", "warmup_steps", "update_every", "evaluate_every"):
        at_most(LONGEST_COUNT, f"learn.{key}", getattr(learn, key))
    at_most(MOST_DRAWS, "learn.jumpstart_draws", learn.jumpstart_draws)
    for key in ("lr", "lr_end"):
        at_most(FASTEST_RATE, f"learn.{key}", getattr(learn, key))
    at_most(LARGEST_DELTA, "learn.huber_delta", learn.huber_delta)
    most = min(LARGEST_SCALE, SCALED / max(largest_reward(world), 1e-30))
    at_most(most, "learn.reward_scale", learn.reward_scale, "with the constants of world.reward")


def check_memory(config: Config, layers: Geometry) -> None:
    """Check what a run holds at once: weights, maps and replay."""
    learn, hidden = config.learn, config.network.hidden
    below = [3 if config.colour else 1, *(layer.filters for layer in layers)]
    weights = sum(n * layer.filters * layer.kernel**2 for n, layer in zip(below, layers, strict=False))
    at_most(
        MOST_WEIGHTS, "network.conv", weights + below[-1] * hidden, "weights; they take 2 GB while they learn"
    )
    maps = below[0] * PICTURE**2 + sum(layer.filters * layer.side**2 for layer in layers)
    why = "4 GB of the maps of network.conv"
    at_most(MOST_NUMBERS // maps, "learn.num_envs", learn.num_envs, why)
    at_most(MOST_NUMBERS // maps, "learn.batch_size", learn.batch_size, why)
    kept = STATE_BYTES
    incremental = config.device == "cpu" and learn.backend is not BackendName.dense and cut_by_words(layers)
    frozen = config.arm.frozen_layers
    # As `Agent` chooses what is kept.
    if incremental and frozen >= linear_from(layers):
        # What frozen layers make of a state before and after, in two bytes a number.
        last = layers[frozen - 1]
        kept += 4 * last.filters * last.side**2
    at_most(REPLAY_BYTES // kept, "learn.replay_size", learn.replay_size, f"{REPLAY_BYTES >> 30} GB")
