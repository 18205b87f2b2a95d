"""`python -m ship_trl.evaluate POLICY... target=CASE`: sail any policies, and table what they reach.

POLICY is random, keep_course, best_known, pretrained (the networks that come with us, beside what their
manifest claims), pretrained:CASE (that of one case), a safetensors file, a result folder (its best and
its last network, beside what it claims of them), or file.py:function of your own. Result folders and
pretrained networks bring their target with them. Without any word it is pretrained.
"""

from __future__ import annotations

import math
import re
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from omegaconf import OmegaConf
from omegaconf.errors import OmegaConfBaseException
from yaml import YAMLError

from ship_trl.cli import complain, make_parser
from ship_trl.config import ConfigError, World, explain
from ship_trl.pretrained import PRETRAINED, find, is_pretrained, networks
from ship_trl.result import RESULT
from ship_trl.sim.cases import Case, load_case, load_world
from ship_trl.transfer.casebase import CONFIG, POLICY, POLICY_LAST

if TYPE_CHECKING:
    from ship_trl.learn.rollout import Episode

HEADINGS = ("case", "policy", "return", "of best known", "ends with", "DCPA, m", "steps", "claimed")
# What a table shows of a return; a claim that is farther off than this is another one.
SHOWN = 0.05


@dataclass(frozen=True)
class Entry:
    """One row to be: a policy by its name, on a case; `claimed` is the return that a folder says it has."""

    policy: str
    label: str
    case: Case
    world: World
    colour: bool
    claimed: float | None = None


def main(arguments: list[str] | None = None) -> None:
    """Sail, print the table, write the GIF."""
    parser = make_parser("ship_trl.evaluate", __doc__)
    parser.add_argument("words", nargs="*", default=[PRETRAINED], metavar="POLICY | target=CASE")
    parser.add_argument(
        "--episodes", type=int, default=1, metavar="N", help="so many at once, mean in the table"
    )
    parser.add_argument("--seed", type=int, default=0, help="of policies that draw")
    parser.add_argument("--colour", action="store_true", help="networks see colours")
    parser.add_argument("--gif", type=Path, metavar="FILE", help="film the first episode of the last policy")
    parser.add_argument("--markdown", action="store_true", help="print a Markdown table")
    options = parser.parse_args(arguments)
    try:
        if options.episodes < 1:
            raise ConfigError(f"--episodes: must be at least 1, got {options.episodes}")
        if not 0 <= options.seed < 2**63:
            raise ConfigError(f"--seed: must be from 0 to 2^63 - 1, got {options.seed}")
        if options.gif is not None and options.gif.suffix != ".gif":
            raise ConfigError(f"--gif: must be a name that ends with .gif, got {options.gif}")
        if options.gif is not None and not options.gif.absolute().parent.is_dir():
            raise ConfigError(f"--gif: no folder {options.gif.absolute().parent}")
        entries = find_entries(options.words, options.colour)
        wrong = table(entries, options.episodes, options.seed, options.gif, options.markdown)
    except (ConfigError, OSError) as error:
        complain(str(error))
        sys.exit(1)
    if wrong:
        complain(f"{len(wrong)} of {len(entries)} do not reach what is claimed of them: {wrong[0]} ...")
        sys.exit(1)


def find_entries(words: list[str], colour: bool) -> list[Entry]:
    """Read the command line's words: policies, and the cases that they sail in.

    Raises:
        ConfigError: a word that is neither, a folder without a result, a policy without a case.
    """
    # A path may hold an equals sign, as seed=0 does.
    names = [w for w in words if not re.match(r"\w+=", w) or Path(w.rpartition(":")[0] or w).exists()]
    given = [word.split("=", 1) for word in words if word not in names]
    settings = {word[0]: word[1] for word in given}
    unknown = sorted(settings.keys() - {"target"})
    if unknown:
        raise ConfigError(f"{unknown[0]}: unknown key; allowed here: target")
    if len(given) > 1:
        raise ConfigError("target: given twice; allowed: once, with several behind commas")
    if not names:
        raise ConfigError("policy: none given; see --help for what is allowed")
    world = load_world()
    targets = [load_case(name, world, "target") for name in settings.get("target", "").split(",") if name]
    entries: list[Entry] = []
    for name in names:
        if Path(name).is_dir():
            entries += of_folder(Path(name), targets)
        elif is_pretrained(name):
            entries += packaged(name, targets, world)
        elif not targets:
            raise ConfigError(
                f"target: none given for {name}; allowed: target=CASE, or several behind commas"
            )
        else:
            entries += [Entry(name, name, case, world, colour) for case in targets]
    return entries


def packaged(name: str, targets: list[Case], world: World) -> list[Entry]:
    """Give the networks that come with us, on `targets` or each on its own case, with what they claim.

    Raises:
        ConfigError: none is of a case that was asked for.
    """
    if not targets:
        chosen = networks() if name == PRETRAINED else [find(name, None)]
        targets = [load_case(one.case, world) for one in chosen]
    entries = []
    for case in targets:
        one = find(name, case)
        claimed = one.episode_return if one.fingerprint == case.fingerprint else None
        entries.append(Entry(str(one.file), name, case, world, colour=False, claimed=claimed))
    return entries


def of_folder(folder: Path, targets: list[Case]) -> list[Entry]:
    """Give the networks of all results at and below a folder, each on its own target or on `targets`.

    Raises:
        ConfigError: there is no result, or its configuration cannot be read.
    """
    from ship_trl.results import collect

    found: list[Entry] = []
    whole, broken = collect(folder)
    for path, error in broken:
        complain(f"{path} {error}; left out")
    for run in whole:
        result, place = run.result, run.folder
        world, colour = settings_of(place)
        cases = targets or [load_case(result.target, world, f"{place / RESULT}: target")]
        label = f"{result.pair} {result.arm} seed {result.seed}"
        for file, key, claim in ((POLICY, "best", result.best), (POLICY_LAST, "final", result.final)):
            if not (place / file).is_file():
                complain(f"{place / file} is not there; left out")
                continue
            claimed = None if targets else claim.episode_return
            name = f"{label}, {key}"
            found += [Entry(str(place / file), name, case, world, colour, claimed) for case in cases]
    if not found:
        raise ConfigError(f"policy: no {RESULT} with its networks at or below {folder}")
    return found


def settings_of(folder: Path) -> tuple[World, bool]:
    """Read the world and the colours of a run from its configuration.

    Raises:
        ConfigError: there is none, or it cannot be read.
    """
    path = folder / CONFIG
    try:
        values: Any = OmegaConf.load(path)
        world: Any = OmegaConf.to_object(OmegaConf.merge(OmegaConf.structured(World), values.world))
        return world, bool(values.colour)
    except OmegaConfBaseException as error:
        raise ConfigError(f"policy: {path}: {explain(error)}") from None
    except (OSError, AttributeError, ValueError, YAMLError) as error:
        raise ConfigError(f"policy: {path} is not a configuration: {' '.join(str(error).split())}") from None


def table(entries: list[Entry], episodes: int, seed: int, gif: Path | None, markdown: bool) -> list[str]:
    """Sail every entry and print what it reached; returns the labels of those that fall short of a claim."""
    from ship_trl.learn.rollout import rollout
    from ship_trl.policies import POLICIES, load_policy
    from ship_trl.results import show
    from ship_trl.run.process import configure_process
    from ship_trl.sim.env import ShipEnv
    from ship_trl.sim.reference import best_known

    configure_process()
    rows, wrong = [], []
    film: tuple[Entry, Any, Episode] | None = None
    for entry in entries:
        # Networks from a file draw for themselves, and ours without training read the state alone.
        pixels = entry.policy not in POLICIES and not entry.policy.endswith(".safetensors")
        env = ShipEnv(entry.case, entry.world, episodes, colour=entry.colour, from_pixels=pixels)
        sailed = rollout(env, load_policy(entry.policy, env, seed))
        reached = sum(episode.episode_return for episode in sailed) / len(sailed)
        rows.append(row(entry, sailed, reached, best_known(entry.case, entry.world).episode_return))
        if entry.claimed is not None and not abs(reached - entry.claimed) < SHOWN:
            wrong.append(f"{entry.label} claims {entry.claimed:.1f} and reaches {reached:.1f}")
        film = entry, env, sailed[0]
    show(HEADINGS, rows, markdown)
    if gif is not None and film is not None:
        from ship_trl.view.film import write_gif

        entry, env, episode = film
        write_gif(
            gif, entry.case, entry.world, episode, env.rasteriser, f"case {entry.case.name}, {entry.label}"
        )
        sys.stdout.write(f"{gif}\n")
    return wrong


def row(entry: Entry, sailed: list[Episode], reached: float, best: float) -> list[str]:
    """Make the row of one policy: means over its episodes, that of their returns is `reached`."""
    ends = [episode.outcome for episode in sailed]
    often = {end: ends.count(end) for end in ("goal", "collision", "timeout") if end in ends}
    ended = (
        ends[0] if len(often) == 1 else ", ".join(f"{end} {n / len(ends):.0%}" for end, n in often.items())
    )
    apart = sum(episode.dcpa for episode in sailed) / len(sailed)
    return [
        entry.case.name,
        entry.label,
        f"{reached:.1f}",
        f"{reached / best:.0%}" if best > 0 and reached > 0 else "-",
        ended,
        f"{apart:.0f}" if math.isfinite(apart) else "-",
        f"{sum(episode.length for episode in sailed) / len(sailed):.0f}",
        "" if entry.claimed is None else f"{entry.claimed:.1f}",
    ]


if __name__ == "__main__":
    main()
