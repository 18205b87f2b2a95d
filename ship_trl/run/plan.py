"""Plan a run before torch is imported: load its cases, hash its settings, check its folder."""

from __future__ import annotations

import dataclasses
import hashlib
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from omegaconf import OmegaConf

from ship_trl.config.arm import SCRATCH, SourceWeights
from ship_trl.config.errors import ConfigError
from ship_trl.config.network import non_default_network
from ship_trl.config.paths import conf_dir
from ship_trl.config.types import Config, plain
from ship_trl.policies.demonstrations import Demonstration, read_demonstrations
from ship_trl.policies.pretrained import PRETRAINED, Pretrained, find, networks
from ship_trl.run.folder import TakenError, check_folder
from ship_trl.run.run import Run
from ship_trl.sim.cases import Case, load_case
from ship_trl.transfer.casebase import rank

# Increase it when runs of the same settings learn something else (world, network, learner, streams). Then no
# result of an older version is shown as one of this version.
ALGORITHM_VERSION = 2
# Prefix of the name of a folder that a study has set aside.
DAMAGED = "damaged-"


def make_run(config: Config) -> Run:
    """Plan the run of a checked configuration, and its source's run first.

    Raises:
        ConfigError: a case is missing or invalid, the folder is not writable, or it holds a run of other
            settings or a damaged result.
    """
    world = config.world
    target = load_case(str(config.target), world, "target")
    config = resolve_pretrained(config, target)
    source, pretrained = None, None
    if not config.arm.is_scratch:
        case = load_case(str(config.source), world, "source")
        if config.arm.weights is SourceWeights.pretrained:
            pretrained = find(PRETRAINED, case, "source")
        elif config.source_file is None and config.arm.has_trained_source:
            alone = dataclasses.replace(
                config.with_arm(SCRATCH),
                pair=None,
                target=config.source,
                demonstrations=None,
                # `overwrite=true` is about the target's folder.
                overwrite=False,
            )
            try:
                source = make_run(alone)
            except TakenError as error:
                raise ConfigError(
                    f"output: {error.folder}, where the source would be trained, holds {error.held}; "
                    "allowed: another output=FOLDER, or "
                    f"target={config.source} method=scratch overwrite=true first"
                ) from None
        elif config.source_file is not None and not Path(config.source_file).is_file():
            raise ConfigError(f"source_file: no file {config.source_file}; a safetensors file is allowed")
    demonstrations: tuple[Demonstration, ...] = ()
    if config.demonstrations is not None:
        demonstrations = tuple(read_demonstrations(Path(config.demonstrations), target, world))
    digest = hash_of(config, target, source, pretrained, demonstrations)
    run = Run(config, target, source, folder_of(config), digest, pretrained, demonstrations)
    check_folder(run)
    return run


def resolve_pretrained(config: Config, target: Case) -> Config:
    """Replace `source=pretrained` by a case: the source of the pair, else the most similar bundled case."""
    if config.source != PRETRAINED:
        return config
    if config.pair is not None:
        pair = conf_dir() / "pair" / f"{config.pair}.yaml"
        if not pair.is_file():
            raise ConfigError(
                f"source: {PRETRAINED} knows the shipped pairs alone, not {config.pair}; "
                "allowed: source=CASE source_weights=pretrained"
            )
        source = str(OmegaConf.load(pair).source)
    else:
        cases = [load_case(one.case, config.world, "source") for one in networks()]
        other_cases = [case for case in cases if case.fingerprint != target.fingerprint]
        source = rank(target, other_cases, config.world)[0].case.name
    if config.arm.is_scratch:
        # Its folder lies beside the transfers of its grid.
        return dataclasses.replace(config, source=source)
    return dataclasses.replace(config, source=source, source_weights=SourceWeights.pretrained)


def folder_of(config: Config) -> Path:
    """Return `<output>/<pair>/<arm>/seed=<k>`; without a pair, the names of the cases replace it."""
    return Path(config.output) / config.label / config.arm_label / f"seed={config.seed}"


def hash_of(
    config: Config,
    target: Case,
    source: Run | None,
    pretrained: Pretrained | None = None,
    demonstrations: Sequence[Demonstration] = (),
) -> str:
    """Return twelve hex digits of a digest over everything that decides what is learned."""
    origin = source.config_hash if source else None
    if config.source_file is not None:
        origin = hashlib.sha256(Path(config.source_file).read_bytes()).hexdigest()
    if config.arm.weights is SourceWeights.random:
        origin = "random"
    elif pretrained is not None:
        # With the name of the case, because the random streams depend on it.
        origin = f"pretrained {Path(str(config.source)).stem} {pretrained.sha256}"
    elif config.arm.weights is SourceWeights.permuted:
        origin = f"permuted {origin}"
    learn = plain(config.learn)
    # Draws do not change what is learned; backends only round differently, as devices do.
    del learn["jumpstart_draws"], learn["backend"]
    values: dict[str, Any] = {
        "algorithm_version": ALGORITHM_VERSION,
        "target": target.fingerprint,
        "source": origin,
        **config.arm.keys,
        "seed": config.seed,
        "colour": config.colour,
        "world": plain(config.world),
        "learn": learn,
    }
    if (network := non_default_network(config.network)) is not None:
        values["network"] = network
    if demonstrations:
        values["demonstrations"] = [one.actions for one in demonstrations]
    return hashlib.sha256(json.dumps(values, sort_keys=True).encode()).hexdigest()[:12]
