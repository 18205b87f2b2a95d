"""By which rules a study is judged: the analysis plan, as it was when the study was begun."""

from __future__ import annotations

import hashlib
import subprocess
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from ship_trl.config.paths import conf_dir

PLAN_TEXT, NUMBERS = "docs/analysis-plan.md", "analysis.yaml"


def digest() -> str | None:
    """Return a digest of the plan's text and numbers; None where the package came without its docs."""
    text = conf_dir().parent / PLAN_TEXT
    if not text.is_file():
        return None
    found = hashlib.sha256(text.read_bytes())
    found.update((conf_dir() / NUMBERS).read_bytes())
    return found.hexdigest()


def stamp() -> dict[str, Any]:
    """Return what names the rules: digest, commit and time of the plan's text, and the time of now."""
    now = datetime.now(UTC).isoformat(timespec="seconds")
    return {"digest": digest(), "commit": committed(conf_dir().parent), "begun": now}


def committed(checkout: Path) -> str | None:
    """Return commit and time of the last change of the plan, None where that is not known.

    A plan that has been changed since its commit has none.
    """
    paths = [PLAN_TEXT, f"conf/{NUMBERS}"]

    def git(*words: str) -> str:
        line = ["git", "-C", str(checkout), *words, "--", *paths]
        return subprocess.run(line, capture_output=True, text=True, check=True, timeout=10).stdout.strip()

    try:
        return None if git("status", "--porcelain") else git("log", "-1", "--format=%H of %cI") or None
    except (OSError, subprocess.SubprocessError):
        return None


def told(rules: dict[str, Any]) -> str:
    """Say by which rules a study is judged, and whether they are still those that it was begun with."""
    if not rules:
        return "No plan was kept with these runs: nothing says that the rules are older than they."
    words = f"Rules: {PLAN_TEXT}, commit {rules['commit']}; the study was begun at {rules['begun']}."
    if rules["commit"] is None:
        words = f"Rules: {PLAN_TEXT}, of no commit; the study was begun at {rules['begun']}."
    if digest() != rules["digest"]:
        words += " They have been changed since."
    return words
