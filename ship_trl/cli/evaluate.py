"""`python -m ship_trl evaluate POLICY... target=CASE|SUITE`: roll out policies, and list what they reach.

POLICY is a name below, pretrained (the bundled network of the target; the default: those of all cases),
pretrained:NAME, a safetensors or ONNX file, a result folder (its best and its last network), file.py:function
of your own, or trusted:FILE.zip, a model of Stable-Baselines3: loading it runs the pickles in it. Result
folders and bundled networks have their own target, and the table shows the return that they claim. Other
policies act in the world of the first result folder or, without one, in the paper's with world.KEY=VALUE.
perturbation.own_position=50 (metres) and the like draw starts at random. Of several episodes the table has
rates and, in metres, the mean least distance to a ship and its 5th percentile. --rules adds a table of what
own ship does by the steering rules, and scores; --all shows every column. Where policies meet the same
suites, a table of their success comes first.
"""

from __future__ import annotations

import math
import sys
from argparse import Namespace
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ship_trl.cli.errors import refusals
from ship_trl.cli.parser import add_number, add_output, add_policies, make_parser
from ship_trl.config.bounds import HEAD_ON_DEGREES, NAUTICAL_MILE, RULES, HalfAngle, Positive
from ship_trl.config.errors import ConfigError, print_error
from ship_trl.policies.pretrained import PRETRAINED
from ship_trl.policies.registry import EPISODES, SHOWN, Entry
from ship_trl.run.entries import find_entries
from ship_trl.run.plan import differences
from ship_trl.sim.cases import load_world
from ship_trl.sim.scale import Scale

if TYPE_CHECKING:
    from ship_trl.learn.rollout import Episode, Policy
    from ship_trl.policies.metrics import Measurements
    from ship_trl.sim.env import ShipEnv

# Columns of scenes of other tools, and a metric: the least distance in nautical miles.
MILES, MILES_OF_ALL, START, AT_SEA = "at sea, NM", "at sea, NM (5 %)", "start, UTC", "least_distance_nm"
HEADINGS = (
    *("case", "policy", "return", "of best known", "ends with", "least distance, m", MILES, START),
    *("steps", "claimed"),
)
# What is shown of them unless all are asked for, with what is claimed if anything is.
SHORT = ("policy", "return", "ends with", "least distance, m", MILES, START)
# The same of several episodes.
SCORES = (
    *("suite", "policy", "episodes", "success", "collision", "timeout", "return", "of best known"),
    *("least distance, m (5 %)", MILES_OF_ALL, *(f"R{rule}" for rule in RULES), "path", "ms", "claimed"),
)
# What is shown of them unless it is asked for more, and what --rules adds.
SHORT_SCORES = ("policy", "success", "collision", "timeout", "least distance, m (5 %)", MILES_OF_ALL)
RULE_SCORES = tuple(f"R{rule}" for rule in RULES)
# The highest scores in suite imazu, of docs/encounters.md.
GOOD_SCORES = "in imazu planners have up to 0.72 to 1.00 (R17: 0.26), networks up to 0.64 to 1.00 (R17: 0.23)"
# Percentile of the least distance, beside its mean.
LOW = 5


def main(arguments: list[str] | None = None) -> None:
    """Print the table, write the files, and check the claims."""
    parser = make_parser("evaluate", __doc__)
    add_policies(parser, [PRETRAINED], "of starts and of policies that draw")
    default = f"where starts are drawn, of each policy; default: {EPISODES}; else each case has one"
    add_number(parser, "--episodes", Positive, None, default)
    add_output(parser, "--gif", (".gif",), "film of the first episode of the last policy")
    add_output(parser, "--csv", (".csv",), "every metric of every episode, a row each")
    add_output(parser, "--sheet", (".png",), "paths of all episodes, failures first")
    add_output(parser, "--failures", (".png",), "paths of failures alone, larger, with closest approaches")
    parser.add_argument("--by", choices=["class"], help="also a row for each class of encounter at its onset")
    add_number(parser, "--head-on", HalfAngle, HEAD_ON_DEGREES, "half-angle of head-on in degrees (5)")
    keep = "where the episodes are kept as demonstrations"
    parser.add_argument("--demonstrations", type=Path, metavar="FOLDER", help=keep)
    parser.add_argument("--rules", action="store_true", help="show what own ship does by the steering rules")
    parser.add_argument("--all", action="store_true", help="show every column")
    parser.add_argument("--markdown", action="store_true", help="print a Markdown table")
    options = parser.parse_intermixed_args(arguments)
    with refusals():
        entries = find_entries(options.words, options.colour)
        wrong = evaluate(entries, options)
    if wrong:
        print_error(f"{len(wrong)} of {len(entries)} do not reach the return that they claim: {wrong[0]}")
        sys.exit(1)


def check(entries: list[Entry], options: Namespace) -> None:
    """Check the options against the entries.

    Raises:
        ConfigError: an option does not fit them.
    """
    if options.demonstrations is not None and not all(entry.suite.is_fixed for entry in entries):
        raise ConfigError("--demonstrations: of single cases, not perturbed; give target=CASE")
    if (options.sheet or options.failures) and any(one.world != entries[0].world for one in entries):
        raise ConfigError("--sheet, --failures: several worlds; allowed: policies of one world")
    if options.episodes is not None and not any(entry.draws for entry in entries):
        raise ConfigError("--episodes: all would be the same; allowed: drawn starts, or a policy that draws")


def evaluate(entries: list[Entry], options: Namespace) -> list[str]:
    """Roll out every entry and print a table; return a line for each that does not reach its claim."""
    from ship_trl.policies.demonstrations import write_demonstration
    from ship_trl.policies.named import rollout_entry
    from ship_trl.run.process import configure_process

    configure_process()
    check(entries, options)
    found, wrong = [], []
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
        one = Scored(entry, episodes, options.head_on, options.seed)
        found.append(one)
        if entry.claimed is not None and not abs(one.reached - entry.claimed) < SHOWN:
            wrong.append(f"{entry.label} claims {entry.claimed:.1f} and reaches {one.reached:.1f}")
        if options.demonstrations is not None:
            for episode in episodes:
                end = episode.episode_return, episode.outcome
                actions, folder = episode.actions.tolist(), options.demonstrations
                write_demonstration(folder, entry.suite.case, entry.world, actions, end, entry.label)
    print_table(found, options)
    if found:
        write_files(found, env, policy, options)
    return wrong


def write_files(found: list[Scored], env: ShipEnv, policy: Policy, options: Namespace) -> None:
    """Write the table and the paths of all episodes, and the film of the last policy."""
    last = found[-1]
    if options.csv is not None:
        from ship_trl.study.report.tables import write_csv

        write_csv(options.csv, [row for one in found for row in one.csv_rows()])
    if options.sheet is not None:
        write_sheet(options.sheet, found)
    if options.failures is not None and all(one.goal for each in found for one in each.episodes):
        sys.stdout.write("--failures: nothing failed\n")
        options.failures = None
    if options.failures is not None:
        write_sheet(options.failures, found, failures=True)
    if options.gif is not None:
        from ship_trl.policies.named import network_of
        from ship_trl.sim.state import first_case
        from ship_trl.view.film import write_gif

        first = last.episodes[0]
        case = first_case(last.entry.suite, first.states[0])
        label, network = last.entry.label, network_of(policy)
        write_gif(options.gif, case, last.entry.world, first, env.rasteriser, label, network)
    for path in filter(None, (options.csv, options.sheet, options.failures, options.gif)):
        sys.stdout.write(f"{path}\n")


def write_sheet(path: Path, found: list[Scored], failures: bool = False) -> None:
    """Write the paths of all episodes; policies take turns, so that the first does not fill the page."""
    from ship_trl.view.pages import write_episode_page

    policies = list(dict.fromkeys(one.entry.label for one in found))
    suites = list(dict.fromkeys(one.suite_name for one in found))
    names, episodes, scales = [], [], []
    for row in range(max(len(one.episodes) for one in found)):
        for one in (each for each in found if row < len(each.episodes)):
            # A case is a suite of its own name.
            names_suite = len(suites) > 1 and len(one.entry.suite.cases) != 1
            label = one.entry.label.removeprefix(f"{PRETRAINED}:")
            lines = [label] * (len(policies) > 1) + [one.suite_name] * names_suite
            names.append("\n".join([*lines, one.scene_name(row)]))
            episodes.append(one.episodes[row])
            scales.append(one.scale_of(row))
    title = f"{', '.join(policies)}: {', '.join(suites)}"
    write_episode_page(path, title, names, episodes, found[0].entry.world, scales, failures)


def print_table(found: list[Scored], options: Namespace) -> None:
    """Print a row for each policy; of several episodes with rates and scores, else with the end."""
    from ship_trl.policies.reference import best_known_return
    from ship_trl.run.console import show
    from ship_trl.transfer.casebase import PLANS

    print_success(found, options.markdown)
    if options.rules and found:
        print_rules(found, options.markdown)
    rows = []
    is_scored = options.by is not None or options.rules or any(len(one.episodes) > 1 for one in found)
    for one in found:
        best = best_known_return(one.entry.suite, one.entry.world, Path("outputs/case_base") / PLANS)
        rows.append(one.row(best) if is_scored else one.row_of_one(best))
        rows += one.class_rows() if options.by is not None else ()
    headings, title = SCORES if is_scored else HEADINGS, None
    shown = [*SHORT_SCORES, *RULE_SCORES * options.rules] if is_scored else list(SHORT)
    if is_scored and not options.all:
        # The shares of three ends add up to one. The interval of the first says how sure they are.
        ends = [headings.index(end) for end in ("collision", "timeout")]
        rows = [[cell.split()[0] if k in ends else cell for k, cell in enumerate(cells)] for cells in rows]
    if options.all:
        shown = list(headings)
    elif is_scored and len(suites := {cells[0] for cells in rows}) == 1:
        counts = sorted({len(one.episodes) for one in found})
        title = f"{suites.pop()}: {' or '.join(map(str, counts))} episode{'s' * (counts != [1])}"
    else:
        shown += [headings[0], *["claimed"] * any(one.entry.claimed is not None for one in found)]
    at_sea = {k: heading for k, heading in enumerate(headings) if heading in (MILES, MILES_OF_ALL, START)}
    empty = [heading for k, heading in at_sea.items() if not any(cells[k] for cells in rows)]
    show(headings, rows, options.markdown, title, [heading for heading in shown if heading not in empty])
    for line in describe_worlds(one.entry for one in found):
        sys.stdout.write(f"{line}\n")
    if is_scored and found:
        world, head_on = found[0].entry.world, found[0].head_on
        sys.stdout.write(f"{describe_scores(world.safe_distance, head_on, shown)}\n")


def print_success(found: list[Scored], markdown: bool) -> None:
    """Print the success of several policies in the same suites, a column for each suite."""
    from ship_trl.run.console import show

    several = [one for one in found if len(one.episodes) > 1]
    policies = list(dict.fromkeys(one.entry.label for one in several))
    suites = list(dict.fromkeys(one.suite_name for one in several))
    reached = {(one.entry.label, one.suite_name): describe_share(one.measured, "goal") for one in several}
    # Networks may have suites of their own, and two files one name.
    if min(len(policies), len(suites)) > 1 and len(reached) == len(several) == len(policies) * len(suites):
        rows = [[policy, *(reached[policy, suite] for suite in suites)] for policy in policies]
        show(("policy", *suites), rows, markdown, "Success")


def print_rules(found: list[Scored], markdown: bool) -> None:
    """Print what each policy did about engaged ships, by class of encounter, and explain it."""
    from ship_trl.policies.rule_table import HEADINGS, describe_rules, rule_rows
    from ship_trl.run.console import show

    safe, suites = found[0].entry.world.safe_distance, {one.suite_name for one in found}
    rows = [
        [one.suite_name, one.entry.label, *cells]
        for one in found
        for cells in rule_rows(one.measured, one.entry.world.safe_distance)
    ]
    shown = HEADINGS[len(suites) == 1 :]
    show(HEADINGS, rows, markdown, "What own ship does about ships, by the steering rules", shown)
    sys.stdout.write(f"{describe_rules(safe)}\n\n")


@dataclass(frozen=True)
class Scored:
    """The episodes of a policy on a suite.

    Attributes:
        head_on: half-angle of the head-on sector, in degrees.
        seed: of the starts.
    """

    entry: Entry
    episodes: list[Episode]
    head_on: float
    seed: int = 0

    @cached_property
    def measured(self) -> Measurements:
        """The metrics of the episodes."""
        from ship_trl.policies.metrics import measure_episodes

        found = measure_episodes(self.episodes, self.entry.world, self.head_on)
        scales = map(self.scale_of, range(len(self.episodes)))
        if lengths := [scale.length for scale in scales if scale is not None]:
            # A file or folder of another tool has a scale for each of its cases.
            found.values[AT_SEA] = found.values["least_distance"] * lengths / NAUTICAL_MILE
        return found

    @cached_property
    def decision_time(self) -> float:
        """The median time (ms) of a decision in the first of the scenes with most target ships, or NaN."""
        from ship_trl.policies.named import time_decision
        from ship_trl.sim.state import SHIP_COUNT

        start = max((one.states[0] for one in self.episodes), key=lambda state: float(state[SHIP_COUNT]))
        return time_decision(self.entry, start, self.seed)

    @property
    def reached(self) -> float:
        """The mean return."""
        return sum(one.episode_return for one in self.episodes) / len(self.episodes)

    @property
    def claimed(self) -> str:
        """The cell of the return that is claimed."""
        return "" if self.entry.claimed is None else f"{self.entry.claimed:.1f}"

    def share(self, best: float | None) -> str:
        """Return the cell of the share that is reached of the best known return."""
        return f"{self.reached / best:.0%}" if best is not None and min(best, self.reached) > 0 else "-"

    @property
    def suite_name(self) -> str:
        """The name of the suite, and whether starts are perturbed."""
        suite = self.entry.suite
        return suite.name + ", perturbed" * (not suite.perturbation.is_none)

    def scale_of(self, row: int) -> Scale | None:
        """Return the scale at sea of an episode's case, None if it has none."""
        cases = self.entry.suite.cases
        return cases[row % len(cases)].scale if cases else None

    def scene_name(self, row: int) -> str:
        """Return the name of an episode's case, or the seed of its random encounter."""
        suite = self.entry.suite
        if not suite.cases:
            return f"seed {self.seed + row}"
        turn, case = divmod(row, len(suite.cases))
        return suite.cases[case].name + (f" ({turn + 1})" if suite.is_drawn else "")

    def row_of_one(self, best: float | None) -> list[str]:
        """Return the cells of `HEADINGS` for one episode; `best` is the best known return."""
        (one,) = self.episodes
        # Cases without target ships have none.
        nearest = f"{one.dcpa:.0f}" if math.isfinite(one.dcpa) else "-"
        reached, scale = (f"{self.reached:.1f}", self.share(best), one.outcome), self.scale_of(0)
        miles = "-" if scale is None or nearest == "-" else scale.miles(one.dcpa)
        at_sea = ("", "") if scale is None else (miles, scale.start[:16])
        return [self.suite_name, self.entry.label, *reached, nearest, *at_sea, str(one.length), self.claimed]

    def row(self, best: float | None) -> list[str]:
        """Return the cells of `SCORES`; `best` is the best known mean return."""
        cells = score_cells(self.measured, self.share(best))
        decision = "-" if math.isnan(self.decision_time) else f"{self.decision_time:.2g}"
        return [self.suite_name, self.entry.label, *cells, decision, self.claimed]

    def class_rows(self) -> Iterator[list[str]]:
        """Yield the same cells for each class of encounter."""
        for name in sorted(set(self.measured.encounters.tolist())):
            cells = score_cells(self.measured.select(self.measured.encounters == name))
            yield [f"{self.suite_name}: {name}", self.entry.label, *cells, "", ""]

    def csv_rows(self) -> Iterator[dict[str, Any]]:
        """Yield a row of each episode: scene, end and every metric, empty where one does not apply."""
        for k in range(len(self.episodes)):
            values, scale = self.measured.of_episode(k).items(), self.scale_of(k)
            yield {
                "policy": self.entry.label,
                "suite": self.entry.suite.name,
                "case": self.scene_name(k),
                "outcome": self.measured.outcomes[k],
                "encounter": self.measured.encounters[k],
                **({} if scale is None else {"start_utc": scale.start}),
                **{name: "" if math.isnan(value) else f"{value:.6g}" for name, value in values},
                **self.ship_cells(k),
                "decision_ms": "" if math.isnan(self.decision_time) else f"{self.decision_time:.3g}",
            }

    def ship_cells(self, row: int) -> dict[str, str]:
        """Return what own ship did about each engaged ship of an episode, as `ship_1_side` and so on."""
        cells = {}
        for name, values in self.measured.ships.items():
            for k, value in enumerate(values[row].tolist(), 1):
                text = value if isinstance(value, str) else "" if math.isnan(value) else f"{value:.6g}"
                cells[f"ship_{k}_{name}"] = text
        return cells


def score_cells(measured: Measurements, share: str = "-") -> list[str]:
    """Return the cells from `episodes` to `path`, with the share of the best known return."""
    import numpy as np

    def distances(name: str, decimals: int) -> str:
        near = measured.known(name) if name in measured.values else np.empty(0)
        return f"{near.mean():.{decimals}f} ({np.percentile(near, LOW):.{decimals}f})" if near.size else ""

    return [
        str(len(measured.outcomes)),
        *(describe_share(measured, end) for end in ("goal", "collision", "timeout")),
        f"{measured.known('return').mean():.1f}",
        share,
        distances("least_distance", 0) or "-",
        distances(AT_SEA, 2),
        *(describe_mean(measured, f"rule_{rule}") for rule in RULES),
        describe_mean(measured, "path_ratio"),
    ]


def describe_share(measured: Measurements, end: str) -> str:
    """Return the share of an outcome with its 95 % interval: "43% (16 to 75)"."""
    from ship_trl.study.statistics import share_interval

    found = share_interval(int((measured.outcomes == end).sum()), len(measured.outcomes))
    return f"{found.value:.0%} ({100 * found.low:.0f} to {100 * found.high:.0f})"


def describe_mean(measured: Measurements, name: str) -> str:
    """Return the mean of a metric where it applies, or a dash."""
    values = measured.known(name)
    return f"{values.mean():.2f}" if values.size else "-"


def describe_worlds(entries: Iterable[Entry]) -> list[str]:
    """Return a line for each world that is not the paper's: keys that differ, and the policies in it."""
    found: dict[str, list[str]] = {}
    for entry in entries:
        changes = ", ".join(differences(entry.world, load_world(), "world"))
        found.setdefault(changes, []).append(entry.label)
    return [f"{changes}: {', '.join(dict.fromkeys(some))}." for changes, some in found.items() if changes]


def describe_scores(safe_distance: float, head_on: float, columns: Sequence[str]) -> str:
    """Return the line that explains the columns of a table of scores."""
    lines = {
        "success": "95 % intervals (Wilson).",
        RULE_SCORES[0]: "R8 to R17: scores of the steering rules after Hagen et al. 2023, mean over "
        f"encounters, collision radius {safe_distance:g} m. 1 is best; {GOOD_SCORES}.",
        "suite": f"Classes by Pedersen, head-on within {head_on:g} degrees.",
        "ms": "ms: time of a decision in one scene.",
    }
    return " ".join(line for column, line in lines.items() if column in columns)
