"""Untrusted files are not executed, name no other path, and are refused in one line."""

import json
import os
import pickle
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import torch
import yaml
from torch import Generator

from ship_trl.config.errors import ConfigError, print_error
from ship_trl.config.types import World
from ship_trl.files.curve import RunError, read_curve
from ship_trl.files.record import read_run
from ship_trl.files.untrusted import MAX_YAML_BYTES
from ship_trl.learn.network import DuelingNetwork
from ship_trl.policies.demonstrations import read_demonstration
from ship_trl.run.checkpoint import CheckpointError
from ship_trl.run.checkpoint import read as read_checkpoint
from ship_trl.run.plan import read_settings
from ship_trl.sim.cases import load_case
from ship_trl.study.manifest import read_plan
from ship_trl.study.tables import PLAN
from ship_trl.transfer.weights import load_weights, read_look

KEY = "SHIP_TRL_A_SECRET"
# A file that exists only if a hostile file was executed.
EXECUTED = "EXECUTED"


class Executes:
    """Runs a command when it is unpickled."""

    def __reduce__(self) -> tuple[Any, ...]:
        return os.system, (f"touch {EXECUTED}",)


def pickled(path: Path, protocol: int = pickle.DEFAULT_PROTOCOL) -> None:
    path.write_bytes(pickle.dumps(Executes(), protocol))


def pickled_as_text(path: Path) -> None:
    pickled(path, 0)


def saved_by_torch(path: Path) -> None:
    torch.save({"conv1.weight": Executes()}, path)


def yaml_call(path: Path) -> None:
    path.write_text(f"start: !!python/object/apply:os.system ['touch {EXECUTED}']\n")


def a_network() -> DuelingNetwork:
    return DuelingNetwork(1, 7, Generator())


# Readers of untrusted files, with the name of the file.
READERS: dict[str, tuple[str, Callable[[Path, World], Any]]] = {
    "weights": ("policy.safetensors", lambda path, world: load_weights(path, a_network(), "policy")),
    "layers of weights": ("policy.safetensors", lambda path, world: read_look(path, "policy")),
    "checkpoint": ("1.safetensors", lambda path, world: read_checkpoint(path)),
    "result": ("result.json", lambda path, world: read_run(path.parent)),
    "curve": ("curve.csv", lambda path, world: read_curve(path.parent)),
    "case": ("mine.yaml", lambda path, world: load_case(str(path), world)),
    "configuration": ("config.yaml", lambda path, world: read_settings(path.parent)),
    "demonstration": ("2-001.json", lambda path, world: read_demonstration(path, 7)),
    "plan of a study": (PLAN, lambda path, world: read_plan(path, "copy")),
}


@pytest.mark.parametrize("write", [pickled, pickled_as_text, saved_by_torch, yaml_call])
@pytest.mark.parametrize("reader", READERS)
def test_no_reader_executes_what_it_reads(
    reader: str, write: Callable[[Path], None], tmp_path: Path, world: World
) -> None:
    name, read = READERS[reader]
    write(tmp_path / name)
    with pytest.raises((ConfigError, RunError, CheckpointError)) as caught:
        read(tmp_path / name, world)
    assert "\n" not in str(caught.value) and not Path(EXECUTED).exists()


def test_unsafe_readers_execute_the_hostile_files(tmp_path: Path) -> None:
    """Otherwise the tests above could not fail."""
    for write, read in (
        (pickled, lambda path: pickle.loads(path.read_bytes())),
        (pickled_as_text, lambda path: pickle.loads(path.read_bytes())),
        (saved_by_torch, lambda path: torch.load(path, weights_only=False)),
        (yaml_call, lambda path: yaml.load(path.read_text(), Loader=yaml.UnsafeLoader)),
    ):
        write(tmp_path / "file")
        read(tmp_path / "file")
        Path(EXECUTED).unlink()


ALIASES = "a: &a [1, 1]\n" + "".join(
    f"{c}: &{c} [{', '.join([f'*{b}'] * 9)}]\n" for b, c in zip("abcdefgh", "bcdefghi", strict=True)
)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (f"ideal_path: ${{oc.env:{KEY}}}\n", "line 1: no interpolation"),
        (f'ideal_path: "\\x24{{oc.env:{KEY}}}"\n', "line 1: no interpolation"),
        (f"start: 1\n${{oc.env:{KEY}}}: 1\n", "line 2: no interpolation"),
        (ALIASES, "line 2: no alias"),
        ("a: &a [*a]\n", "line 1: no alias"),
        ("x: &x {y: 1}\nz: {<<: *x}\n", "line 2: no alias"),
        ("[" * 5000 + "]" * 5000, "nested too deeply"),
        ("a: " + "9" * 5000 + "\n", "integer string conversion"),
        ("a: 1\n" + "#" * MAX_YAML_BYTES, "larger than"),
        ("? [a]\n: 1\n", ""),
        ("a: !!int ship\n", "invalid literal"),
        ("a: !!timestamp x\n", "'NoneType'"),
    ],
    ids=lambda value: value[:12].strip(),
)
def test_yaml_is_values_and_no_more(
    text: str, said: str, tmp_path: Path, world: World, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(KEY, "0123456789")
    path = tmp_path / "config.yaml"
    path.write_text(text)
    for read in (
        lambda: load_case(str(path), world),
        lambda: read_settings(tmp_path),
    ):
        with pytest.raises(ConfigError) as caught:
            read()
        message = str(caught.value)
        assert said in message and "0123456789" not in message and "\n" not in message


@pytest.mark.parametrize("word", ["\x1b]0;title\x07", "a\nb", "\x9b2J", "\u202e"])
def test_no_text_of_a_file_controls_the_terminal(
    word: str, tmp_path: Path, world: World, capsys: pytest.CaptureFixture[str]
) -> None:
    # A schema version is quoted; tables escape names where they are printed.
    (tmp_path / "result.json").write_text(json.dumps({"pair": "", "schema_version": word}))
    with pytest.raises(RunError) as caught:
        read_run(tmp_path)
    print_error(str(caught.value))
    said = capsys.readouterr().err
    assert said.endswith("\n") and said[:-1].isprintable()
