"""Check that an input is used with finite numbers, or refused in one line, in time."""

import contextlib
import io
import re
import resource
import signal
from collections.abc import Iterator
from pathlib import Path
from types import FrameType

import torch
from omegaconf import OmegaConf

from ship_trl.config.errors import ConfigError, one_line
from ship_trl.config.types import Config, World
from ship_trl.fast.worlds import make_env
from ship_trl.sim.cases import Case, CaseFile, TargetShip
from ship_trl.sim.suites import Suite
from ship_trl.study.plan import StudyConfig

SECONDS, MEMORY, MAX_LINE = 30, 3 << 30, 2000


def keys_of(schema: type) -> set[str]:
    """Return every key of a configuration; keys of groups have a prefix."""

    def keys(values: object, prefix: str) -> Iterator[str]:
        for key, value in values.items() if isinstance(values, dict) else ():
            yield f"{prefix}{key}"
            yield from keys(value, f"{prefix}{key}.")

    return set(keys(OmegaConf.to_container(OmegaConf.structured(schema), throw_on_missing=False), ""))


RUN_KEYS, STUDY_KEYS = keys_of(Config), keys_of(StudyConfig)
CASE_KEYS = keys_of(CaseFile) | keys_of(TargetShip) | {"target_ships", "not readable as YAML"}
# Named where no single key is at fault.
KNOWN = RUN_KEYS | STUDY_KEYS | CASE_KEYS | {"overrides", "config", "arm", "pair", "sweep", "hydra"}


def memory_limit() -> int:
    """Return the size of this process in bytes when it has grown by `MEMORY`."""
    pages = int(Path("/proc/self/statm").read_text().split()[0])
    return pages * resource.getpagesize() + MEMORY


@contextlib.contextmanager
def guarded(folder: Path) -> Iterator[io.StringIO]:
    """Limit time and memory of the block, check that it leaves the folder unchanged, and catch stderr."""

    def stop(number: int, frame: FrameType | None) -> None:
        raise TimeoutError(f"not done within {SECONDS} s")

    def listing() -> set[tuple[str, int]]:
        return {(str(path), path.lstat().st_mtime_ns) for path in folder.rglob("*")}

    files, handler = listing(), signal.signal(signal.SIGALRM, stop)
    memory = resource.getrlimit(resource.RLIMIT_AS)
    resource.setrlimit(resource.RLIMIT_AS, (memory_limit(), memory[1]))
    signal.alarm(SECONDS)
    try:
        with contextlib.redirect_stderr(io.StringIO()) as err:
            yield err
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, handler)
        resource.setrlimit(resource.RLIMIT_AS, memory)
    assert listing() == files, f"files were added or changed: {listing() ^ files}"


def check_line(line: str, typed: str = "") -> None:
    """Check that a refusal is one readable line, which names a known key or a typed one."""
    assert line.strip() and line.isprintable() and len(line) <= MAX_LINE, f"not one line: {line[:300]!r}"
    key, colon, what = re.sub(r"^\S+\.ya?ml: ", "", line).partition(":")
    names = {key.split("[")[0].strip(), re.split(r"[./@\[]", key)[0]}
    known = names & KNOWN or (key and (key in one_line(typed) or Path(key).stem in typed))
    assert colon and what.strip() and (known or ": unknown key; " in line), f"names no key: {line[:300]!r}"


def roll_out(case: Suite | Case, world: World, colour: bool = False) -> None:
    """Roll out random actions to the end of the episode, with pixels; all numbers must be finite."""
    env = make_env(case, world, 2, from_pixels=True, colour=colour)
    generator = torch.Generator().manual_seed(0)
    try:
        current = env.reset()
    except ConfigError as error:  # a perturbation that is too large
        check_line(str(error), "suite")
        return
    for _ in range(world.max_steps):
        action = torch.randint(len(world.actions), (2,), generator=generator)
        step, current = env.step_and_maybe_reset(current.set("action", action))
        assert all(bool(torch.isfinite(step["next", key]).all()) for key in ("state", "reward"))
