"""The container images: a user without rights runs them, and may write where results go."""

import re
from pathlib import Path

import pytest

from tests.command import ROOT

FILES = sorted((ROOT / "docker").iterdir())
# A word of a Dockerfile that would stand in the image's history for all to read.
SECRET = re.compile(r"\b(?:ARG|ENV)\b.*(?:KEY|TOKEN|PASSWORD|SECRET)", re.IGNORECASE)


def last_stage(text: str) -> list[str]:
    """The instructions from the last FROM on, lines that go on as one."""
    lines = re.sub(r"\\\n", " ", text).splitlines()
    begins = max(n for n, line in enumerate(lines) if line.startswith("FROM "))
    return [line for line in lines[begins:] if line and not line.startswith("#")]


def user_of(text: str) -> str:
    """Who runs the image: what the last USER of its last stage says, root if it says nothing."""
    users = [line.split()[1] for line in last_stage(text) if line.startswith("USER ")]
    return users[-1].partition(":")[0] if users else "root"


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.name)
def test_a_user_without_rights_runs_it(path: Path) -> None:
    assert user_of(path.read_text()) not in ("root", "0")


@pytest.mark.parametrize(
    ("text", "user"),
    [
        ("FROM a\nUSER ship\nFROM b\n", "root"),
        ("FROM a\nUSER ship\nUSER 0:0\n", "0"),
        ("FROM a\nUSER 1000:1000\n", "1000"),
    ],
)
def test_the_last_user_of_the_last_stage_counts(text: str, user: str) -> None:
    assert user_of(text) == user


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.name)
def test_that_user_may_write_results_and_works_there(path: Path) -> None:
    lines = last_stage(path.read_text())
    made = next(line for line in lines if "install -d" in line)
    owner = re.search(r"-o (\w+)", made)
    assert owner and owner[1] == user_of(path.read_text())
    assert {"/data", "/data/outputs"} <= set(made.split()) and "WORKDIR /data" in lines
    assert "777" not in path.read_text()


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.name)
def test_nothing_secret_and_nothing_from_an_address_is_built_in(path: Path) -> None:
    text = path.read_text()
    assert not SECRET.search(text) and not re.search(r"^ADD |curl |wget ", text, re.MULTILINE)
    assert SECRET.search("ARG WANDB_API_KEY")
