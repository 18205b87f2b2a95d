"""`python -m benchmarks encounters POLICY... target=SUITE,...`: what policies do in suites of encounters.

POLICY is as for `python -m ship_trl evaluate`. Each suite has a table of its policies; large suites
also have one of success by class of encounter. best_known is left out where starts are drawn. The tables of
docs/encounters.md are written with `--markdown docs/encounters.md` and the policies that they name.
"""

from __future__ import annotations

import sys
from argparse import Namespace
from collections.abc import Iterable, Sequence
from pathlib import Path

from ship_trl.cli.errors import refusals
from ship_trl.cli.parser import add_number, add_output, add_policies, add_seed, make_parser
from ship_trl.config.bounds import HEAD_ON_DEGREES, HalfAngle, Positive
from ship_trl.config.errors import ConfigError, print_error
from ship_trl.files.disk import atomic_write
from ship_trl.policies.entry import rollout_entry
from ship_trl.run.entries import find_entries
from ship_trl.run.scores import HEADINGS, Evaluated, describe_scores, describe_worlds

POLICIES = ("keep_course", "vo", "sb_mpc", "apf", "best_known")
SUITES = ("imazu", "traffic_test", "paper_perturbed")
EPISODES = 1000
# Suites of as many cases have a table by class, as suites of random encounters do.
MIN_BY_CLASS = 100
# What is left out: a suite's tables stand alone, and nothing is claimed.
LEFT_OUT = ("suite", "return", "of best known", "claimed")
COLUMNS = [name for name in HEADINGS if name not in LEFT_OUT]
TABLE = Path("outputs/encounters.csv")
# In a page, the tables stand between these lines.
BEGIN, END = "<!-- begin: python -m benchmarks encounters -->", "<!-- end -->"


def main(arguments: list[str]) -> None:
    """Print the tables, and write the CSV file and the page that is asked for."""
    parser = make_parser("encounters", __doc__)
    parser.prog = "python -m benchmarks encounters"
    add_policies(parser)
    add_number(parser, "--episodes", Positive, EPISODES, f"where starts are drawn (default {EPISODES})")
    add_seed(parser, "of starts and of policies that draw")
    add_number(parser, "--head-on", HalfAngle, HEAD_ON_DEGREES, "half-angle of head-on in degrees (5)")
    page = "write the tables there, between its two marks if it has them"
    add_output(parser, "--markdown", (".md",), page)
    add_output(parser, "--csv", (".csv",), f"every metric of every episode (default {TABLE})")
    options = parser.parse_intermixed_args(arguments)
    with refusals():
        words = options.words
        if not any(word.startswith("target=") for word in words):
            words = [*words, f"target={','.join(SUITES)}"]
        if all("=" in word for word in words):
            words = [*POLICIES, *words]
        options.words = words
        run(options)


def run(options: Namespace) -> None:
    """Roll out all policies in all suites, and write what they do."""
    entries = find_entries(options.words, options.colour)

    import torch

    from ship_trl.run.process import configure_process, processor_name
    from ship_trl.study.report.tables import write_csv

    configure_process()
    table = options.csv or TABLE
    table.parent.mkdir(exist_ok=True)
    found: dict[str, list[Evaluated]] = {}
    for entry in entries:
        count = options.episodes if entry.suite.is_drawn else None
        try:
            episodes = rollout_entry(entry, count, options.seed)[2]
        except ConfigError as error:
            if entry.policy != "best_known":
                raise
            print_error(f"{entry.suite.name}: {error}; left out")
            continue
        one = Evaluated(entry, episodes, options.head_on, options.seed)
        found.setdefault(entry.suite.name, []).append(one)
    lines = [f"`python -m benchmarks encounters {' '.join(options.words)}`, seed {options.seed}."]
    lines += [describe_scores(entries[0].world.safe_distance, options.head_on), *describe_worlds(entries)]
    lines += [f"On {processor_name()}, torch {torch.__version__}, {torch.get_num_threads()} thread.", ""]
    for suite, some in found.items():
        lines += [f"### {suite}", "", *suite_table(some), *class_table(some), ""]
    text = "\n".join(lines)
    sys.stdout.write(text)
    if options.markdown is not None:
        write_page(options.markdown, text)
    write_csv(table, [row for some in found.values() for one in some for row in one.csv_rows()])
    for path in filter(None, (options.markdown, table)):
        sys.stdout.write(f"{path}\n")


def suite_table(found: Sequence[Evaluated]) -> list[str]:
    """Return the lines of a suite's table: a row of each policy."""
    cells = [[one.row(None)[HEADINGS.index(column)] for column in COLUMNS] for one in found]
    return markdown([COLUMNS, ["---"] * len(COLUMNS), *cells])


def class_table(found: Sequence[Evaluated]) -> list[str]:
    """Return the lines of a table of success by class of encounter; empty if there are few cases."""
    if 0 < len(found[0].entry.suite.cases) < MIN_BY_CLASS:
        return []
    policy, success = HEADINGS.index("policy"), HEADINGS.index("success")
    rows = [
        {row[0].rpartition(": ")[2]: row[success].split()[0] for row in one.class_rows()} for one in found
    ]
    classes = sorted({name for row in rows for name in row})
    names = [one.row(None)[policy] for one in found]
    cells = [[name, *(row.get(one, "-") for one in classes)] for name, row in zip(names, rows, strict=True)]
    head = ["success by class", *classes]
    return ["", *markdown([head, ["---"] * len(head), *cells])]


def markdown(rows: Iterable[Sequence[str]]) -> list[str]:
    """Return the lines of a Markdown table."""
    return [f"| {' | '.join(row)} |" for row in rows]


def write_page(path: Path, text: str) -> None:
    """Write the tables into a page between its marks; a file without them becomes the tables alone."""
    page = path.read_text() if path.is_file() else ""
    before, begin, rest = page.partition(BEGIN)
    _, end, after = rest.partition(END)
    has_marks = bool(begin and end)
    with atomic_write(path) as draft:
        draft.write_text(f"{before}{begin}\n\n{text}\n{end}{after}" if has_marks else f"{text}\n")
