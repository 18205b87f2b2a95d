"""`--help`, of every verb too, answers at once, without torch and without a screen."""

import subprocess
import sys

import pytest

from ship_trl.cli.help import VERBS
from tests.command import environment

HEAVY = {"torch", "pygame", "wandb", "matplotlib.pyplot", "pandas"}
# A command of each line in one process; what it has imported follows what it prints.
PROGRAM = """
import contextlib, sys
from ship_trl.__main__ import main
for line in sys.stdin:
    sys.argv = ["ship_trl", *line.split()]
    with contextlib.suppress(SystemExit):
        main()
    print("imported", *sys.modules, end="\\0")
"""


@pytest.fixture(scope="module")
def answers(tmp_path_factory: pytest.TempPathFactory) -> dict[str, tuple[str, set[str]]]:
    """What `--help` of each verb, and of none at first, prints and has imported."""
    folder, verbs = tmp_path_factory.mktemp("help"), ["", *VERBS]
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM],
        input="".join(f"{verb} --help\n" for verb in verbs),
        capture_output=True,
        text=True,
        cwd=folder,
        env=environment(),
        check=True,
    )
    assert not list(folder.iterdir())
    parts = [text.rpartition("imported ") for text in done.stdout.split("\0")[:-1]]
    return {verb: (said, set(names.split())) for verb, (said, _, names) in zip(verbs, parts, strict=True)}


@pytest.mark.parametrize("verb", VERBS)
def test_help_imports_nothing_heavy(verb: str, answers: dict[str, tuple[str, set[str]]]) -> None:
    said, imported = answers[verb]
    assert f"python -m ship_trl {verb}" in said and not imported & HEAVY


def test_the_help_of_the_command_names_all_and_imports_next_to_nothing(
    answers: dict[str, tuple[str, set[str]]],
) -> None:
    said, imported = answers[""]
    assert not imported & (HEAVY | {"hydra", "omegaconf"})
    told = {line.split()[0] for line in said.partition("Verbs: ")[2].splitlines()[1:]}
    assert told == set(VERBS)
    # Listed as their files stand in a folder.
    assert "scratch, feature_extraction, finetune, " in said
    assert "csv, tensorboard, wandb, " in said
