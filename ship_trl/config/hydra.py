"""Explain Hydra's errors in one line: the key, then what is allowed."""

from __future__ import annotations

import re

from ship_trl.config.errors import missing_extra
from ship_trl.config.paths import conf_dir, group_names

# The extra that installs each plugin of Hydra.
EXTRAS = {"optuna": "optuna", "submitit_slurm": "slurm", "submitit_local": "slurm"}
# How a message of Hydra's parser of overrides begins.
GRAMMAR = (
    "mismatched input|token recognition error|no viable alternative|extraneous input|missing "
    "|LexerNoViableAltException"
)


def explain_hydra(error: Exception) -> str:
    """Explain an error of Hydra in one line: the key, then what is allowed."""
    text = str(error)
    if found := re.match(r"(?:In '.*?': )?Could not find '([\w-]+)/(.*?)'", text):
        group, name = found.groups()
        if group == "hydra":
            kind, _, name = name.partition("/")
            group = f"hydra/{kind}"
        if name in EXTRAS:
            return f"{group}: {missing_extra(name, EXTRAS[name])}"
        allowed = group_names(group)
        return f"{group}: no {name}" + (f"; allowed: {allowed}" if allowed else "")
    if found := re.match(
        r"Could not (?:override|append to config|delete from config)[^']*'?([\w.@/-]+)", text
    ):
        key = found.group(1).rstrip(".")
        if key in ("suite", "case"):
            return f"{key}: unknown key; write target=NAME; allowed: {group_names(key)}"
        if (conf_dir() / key).is_dir():
            return f"{key}: write +{key}=NAME; allowed: {group_names(key)}"
        return f"{key}: {allowed_keys(key)}"
    text = " ".join(text.partition("\nSee https://hydra.cc")[0].split())
    if re.match(GRAMMAR, text):
        # A value with characters of Hydra's grammar, as seed=0 in a path.
        return f"overrides: {text}; quote such a value twice: \"KEY='VALUE'\""
    return f"overrides: {text}"


def allowed_keys(key: str) -> str:
    """List the keys that are allowed where an unknown `key` was given."""
    from ship_trl.config.algorithm import SETTINGS
    from ship_trl.config.schema import keys_at
    from ship_trl.config.types import Config

    if key.startswith("algorithm."):
        # A grid may choose several algorithms, and an own one may have any.
        names = {re.split("[.:]", build)[-2]: keys_at(keys) for build, keys in SETTINGS.items()}
        own = "; ".join(f"{name}: {', '.join(keys) or 'none'}" for name, keys in names.items())
        return f"unknown key of an algorithm that is chosen; allowed: {own}"
    return f"unknown key; allowed here: {', '.join(keys_at(Config, tuple(key.split('.')[:-1])))}"
