"""The analysis plan that judges a study, as it was when the study was begun."""

from __future__ import annotations

import hashlib
import subprocess
from datetime import UTC, datetime
from typing import Any

from ship_trl.config.paths import conf_dir

PLAN_TEXT, NUMBERS = "docs/analysis-plan.md", "analysis.yaml"


def digest() -> str | None:
    """Return a digest of the plan's text and numbers; None if the package came without its docs."""
    text = conf_dir().parent / PLAN_TEXT
    if not text.is_file():
        return None
    return hashlib.sha256(text.read_bytes() + (conf_dir() / NUMBERS).read_bytes()).hexdigest()


def stamp() -> dict[str, Any]:
    """Return digest and commit of the plan, and the present time."""
    now = datetime.now(UTC).isoformat(timespec="seconds")
    return {"digest": digest(), "commit": last_commit(), "begun": now}


def last_commit() -> str | None:
    """Return commit and time of the plan's last change; None if unknown or not committed."""

    def git(*words: str) -> str:
        line = ["git", "-C", str(conf_dir().parent), *words, "--", PLAN_TEXT, f"conf/{NUMBERS}"]
        return subprocess.run(line, capture_output=True, text=True, check=True, timeout=10).stdout.strip()

    try:
        return None if git("status", "--porcelain") else git("log", "-1", "--format=%H of %cI") or None
    except (OSError, subprocess.SubprocessError):
        return None


def describe_rules(rules: dict[str, Any]) -> str:
    """Say which plan judges a study, and whether the plan has changed since the study was begun."""
    if not rules:
        return "No plan was kept with these runs, so nothing shows that the rules are older than the runs."
    commit = "no commit" if rules["commit"] is None else f"commit {rules['commit']}"
    words = f"Rules: {PLAN_TEXT}, {commit}; the study was begun at {rules['begun']}."
    if digest() != rules["digest"]:
        words += " The text has changed since; that commit has it as it was when the study was begun."
    return words
