"""The workflows: YAML that GitHub reads, actions pinned to a commit, and commands of this checkout."""

import re
from pathlib import Path
from typing import Any

import pytest
import yaml

from tests.command import ROOT

FILES = sorted((ROOT / ".github/workflows").glob("*.yml"))
# owner/name@commit, and the version that it is, for people.
PINNED = re.compile(r"uses: [\w.-]+/[\w./-]+@[0-9a-f]{40} # v\d+\.\d+\.\d+$")


def read(path: Path) -> dict[Any, Any]:
    values = yaml.safe_load(path.read_text())
    assert isinstance(values, dict)
    return values


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_every_action_is_pinned_to_a_commit(path: Path) -> None:
    lines = [line.strip() for line in path.read_text().splitlines() if "uses:" in line]
    assert lines
    for line in lines:
        assert PINNED.search(line), line


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_a_workflow_reads_the_repository_and_no_more(path: Path) -> None:
    values = read(path)
    # YAML 1.1 reads the key `on` as true.
    assert {"push", "pull_request"} <= values[True].keys()
    assert values["permissions"] == {"contents": "read"}
    for job in values["jobs"].values():
        assert job["timeout-minutes"] and "permissions" not in job
        # An expression in a script is put in before the shell reads it; variables are safe.
        assert not any("${{" in step.get("run", "") for step in job["steps"])


def test_the_tests_run_on_every_python_that_is_supported() -> None:
    supported = re.findall(r"Python :: (3\.\d+)", (ROOT / "pyproject.toml").read_text())
    for name in ("tests", "wheel"):
        (job,) = read(ROOT / f".github/workflows/{name}.yml")["jobs"].values()
        assert job["strategy"]["matrix"]["python"] == supported


def test_every_dockerfile_is_built() -> None:
    (job,) = read(ROOT / ".github/workflows/image.yml")["jobs"].values()
    files = sorted(path.name for path in (ROOT / "docker").iterdir())
    assert sorted(job["strategy"]["matrix"]["file"]) == files
