"""What may become of an input: it runs with finite numbers, or one line names its key."""

from __future__ import annotations

import contextlib
import io
import math
import re
import signal
import warnings
from collections.abc import Iterator
from pathlib import Path
from types import FrameType

import torch
from omegaconf import OmegaConf
from torch import Generator, Tensor

from ship_trl.config.errors import ConfigError, one_line
from ship_trl.config.types import Config, Learn, Network, World
from ship_trl.learn.agent import Agent
from ship_trl.learn.network import DuelingNetwork
from ship_trl.sim.cases import Case, CaseFile, TargetShip
from ship_trl.sim.env import ShipEnv
from ship_trl.study.plan.config import StudyConfig

# A refusal takes milliseconds, and the few steps of what is accepted a second at most.
SECONDS = 30.0
# A line that is longer helps nobody.
LONGEST = 2000
ENVIRONMENTS = 3


class TooSlowError(BaseException):
    """An input that would have held the program up."""


class FaultError(AssertionError):
    """An outcome that is not allowed."""


@contextlib.contextmanager
def in_time(seconds: float = SECONDS) -> Iterator[None]:
    """Raise `TooSlowError` where the block takes longer; of the main thread."""

    def stop(number: int, frame: FrameType | None) -> None:
        raise TooSlowError(f"not done within {seconds:g} s")

    before = signal.signal(signal.SIGALRM, stop)
    signal.setitimer(signal.ITIMER_REAL, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, before)


@contextlib.contextmanager
def leaves_nothing(folder: Path) -> Iterator[None]:
    """Check that no file is made, changed or taken away below a folder."""
    before = listing(folder)
    yield
    if listing(folder) != before:
        raise FaultError(f"files were left or changed: {listing(folder) ^ before}")


def listing(folder: Path) -> set[tuple[str, int]]:
    """Names and times of everything below a folder."""
    return {(str(path), path.lstat().st_mtime_ns) for path in folder.rglob("*")}


def keys_of(schema: type) -> set[str]:
    """Every key of a configuration's type, groups too."""
    values = OmegaConf.to_container(OmegaConf.structured(schema), throw_on_missing=False)

    def below(values: object, prefix: str) -> Iterator[str]:
        for key, value in values.items() if isinstance(values, dict) else ():
            yield prefix + str(key)
            yield from below(value, f"{prefix}{key}.")

    return set(below(values, ""))


CONFIG_KEYS = keys_of(Config)
KNOWN = {
    "run": CONFIG_KEYS | {"overrides", "config", "arm", "pair", "sweep", "hydra"},
    "study": keys_of(StudyConfig) | {"overrides", "config"},
    "case": keys_of(CaseFile) | keys_of(TargetShip) | {"target_ships"},
}


def check_line(line: str, kind: str, given: str = "") -> None:
    """Check that a refusal is one line for people, which begins with a key.

    Args:
        line: what was said.
        kind: whose keys there are, of `KNOWN`.
        given: what was typed: a key that is unknown to the program stands there.
    """
    if not line.isprintable() or len(line) > LONGEST:
        raise FaultError(f"not one line: {line[:300]!r}")
    # A case that does not fit the world is named by its file, and the keys are its own.
    told_of_case, places = re.subn(r"^\S+\.ya?ml: ", "", line)
    key, colon, told = told_of_case.partition(":")
    names = {key.split("[")[0].strip(), re.split(r"[./@\[]", key)[0]}
    typed = bool(key) and (key in one_line(given) or Path(key).stem in given)
    known = KNOWN["case"] | KNOWN[kind] | {"not readable as YAML"} if places else KNOWN[kind]
    if not (colon and told.strip() and (names & known or typed or ": unknown key; " in line)):
        raise FaultError(f"names no key: {line[:300]!r}")


def complaint(error: SystemExit, said: str, kind: str, given: str = "") -> None:
    """Check how a command ended that refused its input.

    Args:
        error: how it ended.
        said: all that it printed to stderr.
        kind: as of `check_line`.
        given: as of `check_line`.
    """
    if error.code != 1 or not said.startswith("ship_trl: ") or not said.endswith("\n"):
        raise FaultError(f"exit code {error.code}, and: {said[:300]!r}")
    check_line(said.removeprefix("ship_trl: ")[:-1], kind, given)


def refusal(error: ConfigError, kind: str, given: str = "", where: str = "") -> None:
    """Check a `ConfigError`, which may begin with a place."""
    check_line(str(error).removeprefix(where), kind, given)


@contextlib.contextmanager
def heard() -> Iterator[io.StringIO]:
    """Catch what is printed to stderr."""
    with contextlib.redirect_stderr(io.StringIO()) as said:
        yield said


def finite(name: str, *numbers: Tensor) -> None:
    """Check that all numbers are finite."""
    for tensor in numbers:
        if not bool(torch.isfinite(tensor).all()):
            raise FaultError(f"{name} is not finite")


def sail(case: Case, world: World, colour: bool = False) -> None:
    """Sail random actions and the fastest one to the end of the episode, and draw what is seen."""
    env = ShipEnv(case, world, ENVIRONMENTS, from_pixels=True, colour=colour)
    fastest = max(range(len(world.actions)), key=lambda n: abs(world.actions[n][0]))
    generator = Generator().manual_seed(0)
    current = env.reset()
    for _ in range(3):
        action = torch.randint(len(world.actions), (ENVIRONMENTS,), generator=generator)
        stepped, current = env.step_and_maybe_reset(current.set("action", action))
        after = stepped["next"]
        finite("state", after["state"])
        finite("reward", after["reward"])
        if case.target_ships:
            finite("dcpa", after["dcpa"])
    # And as far as one can go, whatever lies in the way.
    state = env.reset()["state"]
    for step in range(world.max_steps):
        after = env._advance(state, torch.full((ENVIRONMENTS,), fastest))
        finite("state", after.state)
        finite("reward", after.reward)
        state = after.state
        if step in (0, world.max_steps - 1):
            env.rasteriser(state)
            reference = env._transition(state, torch.zeros(ENVIRONMENTS, dtype=torch.long))
            finite("state", reference.state)
            finite("reward", reference.reward)


def learn(network: Network, settings: Learn, colour: bool = False) -> None:
    """Build a network and take one step on random pictures."""
    channels = 3 if colour else 1
    # TorchRL advises against a tau above a half, and takes it.
    warnings.filterwarnings("ignore", "Found an eps value")
    made = DuelingNetwork(channels, 7, Generator().manual_seed(0), network)
    draw = Noise(channels)
    agent = Agent(made, draw, 7, settings, Generator().manual_seed(0))
    replay = agent.replay(settings, Generator().manual_seed(0), torch.device("cpu"))
    replay.extend(transitions(settings.batch_size))
    loss = agent.update(replay.sample(settings.batch_size))
    finite("loss", loss)
    finite("weights", *made.parameters())


class Noise:
    """Pictures of nothing, of one channel or three."""

    def __init__(self, channels: int) -> None:
        self.background = torch.zeros(channels, 84, 84, dtype=torch.uint8)

    def __call__(self, state: Tensor) -> Tensor:
        """Draw a stripe where the state says: [..., 2] to uint8 [..., C, 84, 84]."""
        place = (state[..., 0] * 80).clamp(0, 80)
        stripe = ((torch.arange(84) - place[..., None]).abs() < 6).to(torch.uint8) * 255
        shape = (*state.shape[:-1], *self.background.shape)
        return stripe[..., None, None, :].expand(shape).contiguous()


def transitions(count: int) -> object:
    """Make so many steps of no world in particular."""
    from tensordict import TensorDict

    generator = Generator().manual_seed(0)
    state, after = torch.rand(2, count, 2, generator=generator)
    no = torch.zeros(count, 1, dtype=torch.bool)
    following = {"state": after, "reward": after[:, :1], "done": no, "terminated": no.clone()}
    return TensorDict(
        {"state": state, "action": torch.zeros(count, dtype=torch.long), "next": following},
        batch_size=[count],
    )


def is_number(value: object) -> bool:
    """Whether a value is a finite number."""
    return type(value) in (int, float) and math.isfinite(value)  # type: ignore[arg-type]
