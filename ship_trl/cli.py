"""The command line's own words: help without imports, and errors in one line."""

from __future__ import annotations

import os
import re
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from traceback import walk_tb
from typing import TYPE_CHECKING, NoReturn

from ship_trl.paths import DISK, conf_dir

if TYPE_CHECKING:
    import argparse

# What Hydra finds only if an extra is installed.
EXTRAS = {"optuna": "optuna", "submitit_slurm": "slurm", "submitit_local": "slurm"}
# Begins what the parser of Hydra's overrides says.
GRAMMAR = (
    "mismatched input|token recognition error|no viable alternative|extraneous input|missing "
    "|LexerNoViableAltException"
)
HELP_FLAGS = {"--help", "-h"}

HELP = """\
ship_trl: transfer reinforcement learning in ship collision avoidance.

  python -m ship_trl +pair=high method=finetune layers=3
  python -m ship_trl source=3 target=2 method=feature_extraction layers=2
  python -m ship_trl target=4 method=scratch seed=1
  python -m ship_trl -m +pair=high,low +arm=scratch,FE3,FT3,FTW seed=0,1,2

What to run
  +pair=NAME            {pairs}; or any two cases:
  source=CASE           {cases}, or a YAML file
  target=CASE           the same
  method=METHOD         scratch, feature_extraction, finetune (default)
  layers=N              1 to 4 conv layers (as many as the network has), or all (finetune only)
  +arm=NAME             method and layers at once: {arms}
  source_file=FILE      take the source network from a safetensors file
  source=pretrained     the trained network that comes with us, of the pair's source or the most similar case
  source_weights=NAME   learned; controls: random (has learned nothing), permuted (learned, then shuffled)
  demonstrations=FOLDER put episodes that somebody sailed into the replay first (docs/demonstrations.md)
  seed=N                0 by default

How
  profile=NAME          {profiles} (default quick)
  learn.KEY=VALUE       any value of conf/learn/paper.yaml, as learn.episodes=1000
  network=NAME          {networks} (default paper)
  device=cpu|cuda       colour=true|false
  logger=NAME           csv (always written), wandb, tensorboard, or all
                        wandb.mode=offline|online wandb.project=NAME wandb.entity=NAME
  output=FOLDER         results go to FOLDER/<pair>/<arm>/seed=<k>
  overwrite=true        replace a finished run of other settings there, or a damaged one

  -m, --multirun        a grid: several values behind a comma
  +sweep=NAME           look for good settings, by Optuna: {sweeps}
  objective=NAME        what a sweep maximises: late (greedy return after exploration), final, best
  --cfg job             print the configuration and stop
  --hydra-help          what Hydra adds

Other commands: python -m ship_trl.COMMAND --help
  evaluate              what policies reach: networks, random, the planner's, your own
  watch, record         an episode in a window; the same as GIF, MP4 or PNG frames
  play                  steer a ship yourself
  cases                 the cases, their similarity, which source and arm for a target, a picture
  results               a table of finished runs, their learning curves
  explain               what a network has learned to see, on one page
  export                a network as an ONNX file
  study, report         every figure and control of the paper over seeds; the report of its runs
  pretrain              the networks that come with the package, trained anew
  bench                 how fast, beside other tools (in a checkout)
"""


def names(group: str) -> str:
    """Names of a config group, for people."""
    return ", ".join(sorted(path.stem for path in (conf_dir() / group).glob("*.yaml")))


def print_help() -> None:
    """Print the help; imports nothing but the standard library."""
    values = {key: names(key[:-1]) for key in ("pairs", "cases", "arms", "profiles", "networks", "sweeps")}
    print(HELP.format(**values), end="")


def complain(line: str) -> None:
    """Say in one line what is wrong."""
    from ship_trl.config import one_line

    print(f"ship_trl: {one_line(line)}", file=sys.stderr)


def make_parser(module: str, description: str | None) -> argparse.ArgumentParser:
    """Of a command's options; what is wrong with them is one line and exit code 1, as everywhere."""
    # Here, for `--help` of the main command does without.
    import argparse

    class Parser(argparse.ArgumentParser):
        def error(self, message: str) -> NoReturn:
            complain(f"{message}; see {self.prog} --help")
            sys.exit(1)

    # Examples stand on lines of their own, which argparse would join.
    raw = "\n    " in (description or "")
    formatter = argparse.RawDescriptionHelpFormatter if raw else argparse.HelpFormatter
    return Parser(prog=f"python -m {module}", description=description, formatter_class=formatter)


@contextmanager
def refusals() -> Iterator[None]:
    """Around a command: what is wrong with its input, or a file that cannot be written, in one line."""
    from ship_trl.config import ConfigError

    try:
        yield
    except ConfigError as error:
        complain(str(error))
        sys.exit(1)
    except OSError as error:
        complain(explain_file(error))
        sys.exit(1)


@contextmanager
def job_errors() -> Iterator[None]:
    """Around one job: its own `ConfigError`, or a file that cannot be written, in one line.

    A single run ends with it. In a sweep it goes on as an exception, because SystemExit would
    abort the other jobs too.
    """
    from hydra.core.hydra_config import HydraConfig
    from hydra.types import RunMode

    from ship_trl.config import ConfigError
    from ship_trl.stop import TIME_TO_STOP, StoppedError, die_of

    try:
        yield
    except StoppedError as error:
        complain(str(error))
        if HydraConfig.get().mode is RunMode.RUN:
            sys.exit(128 + error.number)
        # A process of a grid would be given the next run. When the first ends, joblib kills the others,
        # which may still write.
        time.sleep(TIME_TO_STOP)
        die_of(error.number)
    except (ConfigError, OSError) as error:
        if not explained(error):
            raise
        complain(explain_file(error) if isinstance(error, OSError) else str(error))
        if HydraConfig.get().mode is RunMode.RUN:
            sys.exit(1)
        raise


@contextmanager
def hydra_errors() -> Iterator[None]:
    """Turn what is the user's to mend into one line on stderr and exit code 1.

    Hydra prints its own errors over several lines unless HYDRA_FULL_ERROR is set; then it raises
    them. Someone who set it wants the traceback and gets it.
    """
    if os.environ.get("HYDRA_FULL_ERROR", "") not in ("", "0"):
        yield
        return
    os.environ["HYDRA_FULL_ERROR"] = "1"
    try:
        yield
    except KeyboardInterrupt:
        complain("interrupted; the same command goes on from the last checkpoint, if there is one")
        sys.exit(130)
    except Exception as error:
        line = explain_command(error)
        if line is None:
            raise
        complain(line)
        sys.exit(1)


def check_flags(words: list[str]) -> None:
    """Refuse a flag that Hydra does not know, in one line; Hydra prints its usage, and ends with code 2.

    Raises:
        ConfigError: there is one, or it lacks its value.
    """
    from hydra._internal.utils import get_args_parser

    from ship_trl.config import ConfigError

    def refuse(message: str) -> NoReturn:
        raise ConfigError(f"{message}; keys are given without dashes, as target=4; see --help")

    parser = get_args_parser()
    vars(parser)["error"] = refuse
    parser.parse_args(words)


def explain_command(error: Exception) -> str | None:
    """One line for what ended a command, or None where it is not the user's to mend."""
    import yaml
    from hydra.errors import HydraException
    from omegaconf.errors import OmegaConfBaseException

    from ship_trl.config import ConfigError, explain

    match error:
        case ConfigError():
            return f"this sweep had a job that was refused: {error}"
        case HydraException():
            return explain_hydra(error)
        case OmegaConfBaseException():
            return explain(error)
        case yaml.YAMLError():
            return f"config: not YAML: {' '.join(str(error).split())}"
        case OSError():
            return explain_file(error) if explained(error) else None
    # Of some overrides Hydra makes other errors than its own, as a TypeError of hydra/job_logging=[[1]] or of
    # ~network.conv.0.
    if not origin(error).startswith(("hydra", "antlr4")):
        return None
    known = isinstance(error, ValueError)
    return explain_hydra(error) if known else f"overrides: Hydra cannot read them ({error})"


def explained(error: Exception) -> bool:
    """Whether one line says enough of an error; of an `OSError` about no file a traceback says more."""
    return not isinstance(error, OSError) or error.filename is not None or error.errno in DISK


def explain_file(error: OSError) -> str:
    """One line for an error of the file system: the file, then the reason."""
    # Of two files, as in copying and renaming, the second is written.
    file = error.filename2 or error.filename or "a file"
    return f"{file}: {error.strerror or error}"


def origin(error: BaseException) -> str:
    """Name the module in which an error was raised; of what OmegaConf raises, the one that called it."""
    names = [str(frame.f_globals.get("__name__", "")) for frame, _ in walk_tb(error.__traceback__)]
    return next((name for name in reversed(names) if not name.startswith("omegaconf")), "")


def explain_hydra(error: Exception) -> str:
    """One line for an error of Hydra's: the key, and what is allowed there."""
    text = str(error)
    if found := re.match(r"(?:In '.*?': )?Could not find '([\w-]+)/(.*?)'", text):
        group, name = found.groups()
        if group == "hydra":
            kind, _, name = name.partition("/")
            group = f"hydra/{kind}"
        if name in EXTRAS:
            return f"{group}: {name} is not installed; ship_trl[{EXTRAS[name]}] brings it"
        allowed = names(group)
        return f"{group}: no {name}" + (f"; allowed: {allowed}" if allowed else "")
    if found := re.match(
        r"Could not (?:override|append to config|delete from config)[^']*'?([\w.@/-]+)", text
    ):
        key = found.group(1).rstrip(".")
        if (conf_dir() / key).is_dir():
            return f"{key}: write +{key}=NAME; allowed: {names(key)}"
        return f"{key}: {allowed_keys(key)}"
    text = " ".join(text.partition("\nSee https://hydra.cc")[0].split())
    if re.match(GRAMMAR, text):
        # A value that holds what Hydra's grammar takes for its own, as seed=0 in a path.
        return f"overrides: {text}; quote such a value twice: \"KEY='VALUE'\""
    return f"overrides: {text}"


def allowed_keys(key: str) -> str:
    """Say what may stand where an unknown `key` was given."""
    import dataclasses
    import typing

    from ship_trl.config import Config

    place: type = Config
    for part in key.split(".")[:-1]:
        hints = typing.get_type_hints(place)
        if dataclasses.is_dataclass(hints.get(part)):
            place = hints[part]
    return f"unknown key; allowed here: {', '.join(f.name for f in dataclasses.fields(place))}"
