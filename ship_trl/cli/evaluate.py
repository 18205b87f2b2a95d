"""`python -m ship_trl evaluate POLICY... target=CASE|SUITE`: roll out policies, and list what they reach.

POLICY is random, keep_course, best_known, pretrained (all bundled networks; the default), pretrained:CASE, a
safetensors file, a result folder (its best and its last network), or file.py:function of your own. Result
folders and bundled networks have their own target, and the table shows the return that they claim.
perturbation.own_position=50 (metres) and the like draw starts at random. Of several episodes the table has
means, and the shares of goals and collisions with 95 % intervals.
"""

from __future__ import annotations

import math
import sys
from argparse import Namespace
from collections import Counter
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ship_trl.cli.entries import find_entries
from ship_trl.cli.errors import refusals
from ship_trl.cli.parser import add_number, add_output, add_policies, add_seed, make_parser
from ship_trl.config.bounds import Positive
from ship_trl.config.errors import ConfigError, print_error
from ship_trl.policies.entry import EPISODES, SHOWN, Entry, rollout_entry
from ship_trl.policies.pretrained import PRETRAINED

if TYPE_CHECKING:
    from ship_trl.learn.rollout import Episode

HEADINGS = ("case", "policy", "return", "of best known", "ends with", "DCPA, m", "steps", "claimed")


def main(arguments: list[str] | None = None) -> None:
    """Print the table, write the GIF, and check the claims."""
    parser = make_parser("evaluate", __doc__)
    add_policies(parser, [PRETRAINED])
    default = f"of each policy; default: each case once, {EPISODES} where starts are drawn"
    add_number(parser, "--episodes", Positive, None, default)
    add_seed(parser, "of starts and of policies that draw")
    add_output(parser, "--gif", (".gif",), "film of the first episode of the last policy")
    keep = "where the episodes are kept as demonstrations"
    parser.add_argument("--demonstrations", type=Path, metavar="FOLDER", help=keep)
    parser.add_argument("--markdown", action="store_true", help="print a Markdown table")
    options = parser.parse_intermixed_args(arguments)
    with refusals():
        entries = find_entries(options.words, options.colour)
        wrong = evaluate(entries, options)
    if wrong:
        print_error(f"{len(wrong)} of {len(entries)} do not reach the return that they claim: {wrong[0]}")
        sys.exit(1)


def evaluate(entries: list[Entry], options: Namespace) -> list[str]:
    """Roll out every entry and print a table; return a line for each that does not reach its claim."""
    from ship_trl.cli.table import show
    from ship_trl.policies.demonstrations import write_demonstration
    from ship_trl.policies.reference import best_known_return
    from ship_trl.run.process import configure_process

    configure_process()
    if options.demonstrations is not None and not all(entry.suite.is_fixed for entry in entries):
        raise ConfigError("--demonstrations: of single cases, not perturbed; give target=CASE")
    rows, wrong = [], []
    film: tuple[Entry, Any, Any, Episode] | None = None
    for entry in entries:
        try:
            env, policy, episodes = rollout_entry(entry, options.episodes, options.seed)
        except ConfigError as error:
            # The other networks of a folder are shown, but a policy that was named must be valid.
            if entry.label == entry.policy or len(entries) == 1:
                raise
            print_error(f"{error}; left out")
            wrong.append(f"{entry.label} cannot be read")
            continue
        reached = sum(episode.episode_return for episode in episodes) / len(episodes)
        rows.append(row(entry, episodes, reached, best_known_return(entry.suite, entry.world)))
        if entry.claimed is not None and not abs(reached - entry.claimed) < SHOWN:
            wrong.append(f"{entry.label} claims {entry.claimed:.1f} and reaches {reached:.1f}")
        film = entry, env, policy, episodes[0]
        if options.demonstrations is not None:
            for one in episodes:
                end = one.episode_return, one.outcome
                actions, folder = one.actions.tolist(), options.demonstrations
                write_demonstration(folder, entry.case, entry.world, actions, end, entry.label)
    show(HEADINGS, rows, options.markdown)
    if options.gif is not None and film is not None:
        from ship_trl.policies.named import network_of
        from ship_trl.sim.state import first_case
        from ship_trl.view.film import write_gif

        entry, env, policy, episode = film
        network, case = network_of(policy), first_case(entry.suite, episode.states[0])
        write_gif(options.gif, case, entry.world, episode, env.rasteriser, entry.label, network)
        sys.stdout.write(f"{options.gif}\n")
    return wrong


def row(entry: Entry, episodes: list[Episode], reached: float, best: float | None) -> list[str]:
    """Make the row of one policy: means over its episodes; `reached` is their mean return."""
    count = len(episodes)
    # Cases without target ships have no DCPA.
    dcpa = [episode.dcpa for episode in episodes if math.isfinite(episode.dcpa)]
    return [
        entry.suite.name + ", perturbed" * (not entry.suite.perturbation.is_none),
        entry.label,
        f"{reached:.1f}",
        f"{reached / best:.0%}" if best is not None and min(best, reached) > 0 else "-",
        episodes[0].outcome if count == 1 else describe_ends(episodes),
        f"{sum(dcpa) / len(dcpa):.0f}" if dcpa else "-",
        f"{sum(episode.length for episode in episodes) / count:.0f}",
        "" if entry.claimed is None else f"{entry.claimed:.1f}",
    ]


def describe_ends(episodes: list[Episode]) -> str:
    """Return the shares of goals and collisions with 95 % intervals, and of timeouts if there are any."""
    from ship_trl.study.analysis.statistics import share_interval

    ends, count = Counter(episode.outcome for episode in episodes), len(episodes)
    shares = {end: share_interval(ends[end], count) for end in ("goal", "collision")}
    parts = [
        f"{end} {one.value:.0%} ({100 * one.low:.0f} to {100 * one.high:.0f})" for end, one in shares.items()
    ]
    parts += [f"timeout {ends['timeout'] / count:.0%}"] * bool(ends["timeout"])
    return ", ".join(parts)
