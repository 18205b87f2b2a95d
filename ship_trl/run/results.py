"""Find the finished runs in a folder and below, and tell their settings apart. No torch."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from omegaconf import OmegaConf
from yaml import YAMLError

from ship_trl.config.errors import one_line, print_error
from ship_trl.config.paths import conf_files
from ship_trl.files.curve import RunError
from ship_trl.files.disk import read_file
from ship_trl.files.record import RESULT, RunRecord, read_run
from ship_trl.files.untrusted import MAX_YAML_BYTES, read_yaml
from ship_trl.foreign.suites import holds_situations, is_known
from ship_trl.run.plan import DAMAGED, flatten
from ship_trl.transfer.casebase import CONFIG

# Keys of a configuration that name or place of a run hold, and those that only change the last digits.
NOT_NAMED = {"seed", "method", "layers", "source_weights", "device", "learn.backend", "learn.jumpstart_draws"}
# Keys of a transfer alone; they tell the runs of an arm apart.
OF_TRANSFER = ("source", "source_file", "demonstrations", "transfer.")
# The seed of a run, also in the path of its source.
SEED = re.compile(rb"(?m)^seed: .*$|(?<=seed=)\d+(-[0-9a-f]{12})?")


def locate(name: str, folder: Path) -> str:
    """Return the file or folder that a run in `folder` was given by a path relative to where it was started.

    A name that is no path of a file, or of a folder of other tools' files, is returned as it is.
    """
    is_file, is_folder = bool(Path(name).suffix), not is_known(name)
    for place in (parent / name for parent in folder.absolute().parents):
        if (is_file and place.is_file()) or (is_folder and holds_situations(place)):
            return str(place)
    return name


def collect(folder: Path) -> list[RunRecord]:
    """Return the results in `folder` and below; name those that cannot be read on stderr."""
    found = []
    for path in sorted(folder.rglob(RESULT)):
        if path.parent.name.startswith(DAMAGED):
            continue
        try:
            part = one_line("/".join(path.relative_to(folder).parts[:-4]))
            found.append(replace(read_run(path.parent, part), below=folder))
        except RunError as error:
            print_error(f"{path.parent}: {error}; left out")
    return name_settings(found)


def drop_copies(found: Iterable[RunRecord]) -> list[RunRecord]:
    """Drop copies of another run, which are not further seeds, and print a warning for each."""
    kept: dict[tuple[str, str], RunRecord] = {}
    for one in found:
        known = kept.setdefault((one.label, repr(one)), one)
        if known is not one:
            print_error(f"{one.folder} is a copy of {known.folder}; left out")
    return list(kept.values())


def name_settings(found: Sequence[RunRecord]) -> list[RunRecord]:
    """Return runs with their `changes`: two runs of an arm have the same words if only their seeds differ."""
    known: dict[bytes, dict[str, str]] = {}
    runs, settings = list(found), [read_run_settings(one, known) for one in found]
    # Those of a transfer are compared in the runs of an arm that are alike otherwise.
    for of_transfer in (False, True):
        groups: dict[tuple[str, ...], list[int]] = {}
        for k, one in enumerate(runs):
            name = (one.label, one.arm, one.changes) if of_transfer else (one.label,)
            groups.setdefault(name, []).append(k)
        for group in groups.values():
            own = [
                {
                    key: value
                    for key, value in settings[k].items()
                    if key.startswith(OF_TRANSFER) is of_transfer
                }
                for k in group
            ]
            for k, words in zip(group, tell_apart(own), strict=True):
                runs[k] = replace(runs[k], changes=f"{runs[k].changes} {words}".strip())
    return runs


def read_run_settings(one: RunRecord, known: dict[bytes, dict[str, str]]) -> dict[str, str]:
    """Return the settings of a run, without arm and seed, by dotted key; `known` holds those read before."""
    path = one.folder / CONFIG
    settings = {"profile": one.profile, "algorithm_version": str(one.algorithm_version)}
    try:
        # Reading YAML is slow, and the files of an arm differ in their seeds alone.
        text = SEED.sub(b"*", read_file(path, MAX_YAML_BYTES))
        if text not in known:
            values: Any = OmegaConf.to_container(read_yaml(path))
            named = ((key, value) for key, value in flatten(values) if key not in NOT_NAMED)
            # Files of older runs lack keys that are null by default.
            told = {key: str(value) for key, value in named if value is not None}
            told = {key: SEED.sub(b"*", value.encode()).decode() for key, value in told.items()}
            known[text] = {"network": network_name(values.get("network") or {})} | told
    except (OSError, YAMLError, AttributeError):
        return settings | {CONFIG: "missing"}
    return settings | {CONFIG: "there"} | known[text]


def network_name(values: Any) -> str:
    """Return the name in conf/network of the layers in a configuration, or `own`."""
    for name, path in sorted(conf_files("network").items()):
        layers = {key: value for key, value in OmegaConf.load(path).items() if key != "vector_time"}
        if all(values.get(key) == value for key, value in layers.items()):
            return name
    return "own"


def tell_apart(settings: Sequence[Mapping[str, str]]) -> list[str]:
    """Return words for the settings of each run: a few keys with values that are not the most frequent.

    Two runs have the same words if and only if they have the same settings.
    """
    kept: list[str] = []

    def kinds(keys: Sequence[str]) -> int:
        return len({tuple(one.get(key) for key in keys) for one in settings})

    for key in dict.fromkeys(key for one in settings for key in one):
        if kinds([*kept, key]) > kinds(kept):
            kept.append(key)
    words: list[list[str]] = [[] for _ in settings]
    for key in kept:
        (usual, most), (_, second) = Counter(one.get(key) for one in settings).most_common(2)
        for one, own in zip(settings, words, strict=True):
            if one.get(key) != usual or most == second:
                own.append(f"{key}={one.get(key, '-')}")
    return [" ".join(own) for own in words]


def group_runs(found: Iterable[RunRecord]) -> dict[str, list[RunRecord]]:
    """Group runs that differ only in their seeds; return each group by its name, sorted by seed."""
    runs = sorted(found, key=lambda one: (str(one.below), one.part, one.pair, one.name, one.seed))
    several = len({one.below for one in runs}) > 1
    groups: dict[str, list[RunRecord]] = {}
    for one in runs:
        name = f"{one.label} {one.name}"
        groups.setdefault(f"{one.below}: {name}" if several else name, []).append(one)
    return groups
