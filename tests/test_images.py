"""The container images run as an unprivileged user, who may write results."""

import re
from pathlib import Path

import pytest

from tests.command import ROOT

FILES = sorted((ROOT / "docker").iterdir())


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.name)
def test_an_unprivileged_user_runs_it_and_may_write_results(path: Path) -> None:
    text = re.sub(r"\\\n", " ", path.read_text())
    last_stage = text[text.rindex("\nFROM ") :].splitlines()
    user = [line.split()[1] for line in last_stage if line.startswith("USER ")][-1].partition(":")[0]
    assert user not in ("root", "0")
    made = next(line for line in last_stage if "install -d" in line)
    assert f"-o {user} " in made and {"/data", "/data/outputs"} <= set(made.split())
    assert "WORKDIR /data" in last_stage and "777" not in text


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.name)
def test_the_image_installs_the_locked_versions_and_has_no_secret(path: Path) -> None:
    text = path.read_text()
    installs = [line for line in text.splitlines() if "pip install" in line]
    assert installs and all("--constraint requirements.lock" in line for line in installs)
    assert not re.search(r"\b(?:ARG|ENV)\b.*(?:KEY|TOKEN|PASSWORD|SECRET)", text, re.IGNORECASE)
    assert not re.search(r"^ADD |curl |wget ", text, re.MULTILINE)
