"""`python -m tests.findings`: the numbers of docs/findings.md and of the README, from the kept tables.

A page names what it measures in the words of `ship_trl.cli.ask`, with the interval behind it, and the same
of greedy evaluations where that is to be seen beside it:

    `high: FTW above scratch (area)` +0.06 (+0.02 to +0.11; greedy +0.17)

or, in a table, where without what and what without where:

    | | high | low |
    | `FTW above scratch (area)` | +0.06 (+0.02 to +0.11) | +0.03 (+0.00 to +0.06) |

and how alike layers are, of the report's cka.csv:

    | | conv1 | conv2 |
    | `high: scratch beside source` | 0.98 | 0.95 |

The command writes the numbers anew, with as many places as stand there, and names what it changed; a test
holds that there is nothing to change.
"""

from __future__ import annotations

import csv
import re
import sys
from functools import cache
from pathlib import Path

from ship_trl.cli.ask import answers
from ship_trl.study.analysis.statistics import Estimate
from ship_trl.study.analysis.study import Study, read_study
from tests.command import ROOT
from tests.study.test_confirmatory import FOLDER, REPORT, SEEN

PAGES = ("docs/findings.md", "docs/open-claims.md", "docs/controls.md", "README.md")
NUMBER = r"[+-]\d+\.\d+"
# A line may end between any two words.
NUMBERS = rf"{NUMBER}\s+\({NUMBER}\s+to\s+{NUMBER}(?:;\s+greedy\s+{NUMBER})?\)"
CKA = r"(?<=^ )\d\.\d\d(?= $)"
# A claim is told by the seeds of the look that decided it.
FIRST = r"\s+on\s+the\s+first\s+(?P<seeds>\d+)\s+seeds"
TOLD = re.compile(rf"`(?P<what>[^`:]+:\s[^`]+)`(?:{FIRST})?\s+(?P<numbers>{NUMBERS})")


def section(text: str, page: str) -> str:
    """Return what a page says was found: of the README one section."""
    if page != "README.md":
        return text
    return "## What was found\n" + text.partition("## What was found\n")[2].partition("\n## ")[0]


def anew(text: str, study: Study) -> str:
    """Write all numbers of a text anew, everything else as it was."""
    inline = TOLD.sub(
        lambda match: match[0].replace(
            match["numbers"], told(match["what"], match["numbers"], study, int(match["seeds"] or SEEN))
        ),
        text,
    )
    head: list[str] = []
    lines = []
    for line in inline.splitlines(keepends=True):
        cells = line.split("|")
        head = [] if len(cells) < 3 else head or cells
        what = re.fullmatch(r" `([^`]+)` ", cells[1]) if head and len(cells) == len(head) else None
        lines.append("|".join(row(head, what[1], cells, study)) if what else line)
    return "".join(lines)


def row(head: list[str], what: str, cells: list[str], study: Study) -> list[str]:
    """Write a table's row anew: what is told of, where its heading says."""
    alike = re.fullmatch(r"(\w+): (\w+) beside ([\w ]+)", what)
    made = []
    for where, cell in zip(map(str.strip, head), cells, strict=True):
        numbers = re.search(CKA if alike else NUMBERS, cell)
        if numbers is None:
            made.append(cell)
        elif alike:
            made.append(cell.replace(numbers[0], ckas()[*alike.groups(), where]))
        else:
            made.append(cell.replace(numbers[0], told(f"{where}: {what}", numbers[0], study)))
    return made


@cache
def ckas() -> dict[tuple[str, ...], str]:
    """Read how alike layers are, by pair, arm, what it is beside, and layer."""
    with (REPORT / "cka.csv").open(newline="") as file:
        return {
            (row["pair"], row["arm"], row["beside"], row["layer"]): f"{float(row['cka']):.2f}"
            for row in csv.DictReader(file)
        }


def told(question: str, numbers: str, study: Study, seeds: int = SEEN) -> str:
    """Write the numbers of one contrast anew."""
    (finding,) = answers(study, [" ".join(question.split())], seeds)
    greedy = [one for name, one in finding.beside.items() if name.startswith("greedy")]
    found = iter([*ends(finding.estimate), *(one.value for one in greedy)])
    return re.sub(NUMBER, lambda number: written(next(found), number[0]), numbers)


def ends(one: Estimate) -> tuple[float, float, float]:
    """Return an estimate and the ends of its interval."""
    return one.value, one.low, one.high


def written(value: float, as_before: str) -> str:
    """Write a number with as many places as another one has."""
    return f"{value:+.{len(as_before.partition('.')[2])}f}"


# Of the study at the paper's length, which has too few seeds for intervals.
LONG = ROOT / "outputs/paper_high"
LONG_ARMS = ("FE1", "FE2", "FE3", "FE4", "FT3", "FTW")
LONG_METRICS = ("early area", "area", "asymptote", "time")


def long_table() -> str:
    """Write what each arm is above scratch at the paper's length: means, and how many seeds are above 0."""
    study = read_study(LONG)
    lines = [f"| | {' | '.join(LONG_METRICS)} |", "| --- |" + " --- |" * len(LONG_METRICS)]
    for arm in LONG_ARMS:
        cells = []
        for metric in LONG_METRICS:
            word = "sooner than" if metric == "time" else "above"
            (one,) = answers(study, [f"high: {arm} {word} scratch ({metric})"])
            above = sum(value > 0 for value in one.differences)
            cells.append(f"{one.estimate.value:+.3f} ({above} of {one.seeds})")
        lines.append(f"| {arm} | {' | '.join(cells)} |")
    return "\n".join(lines)


def main() -> None:
    """Rewrite the pages."""
    study = read_study(FOLDER)
    for page in PAGES:
        path: Path = ROOT / page
        text = path.read_text()
        before = section(text, page)
        after = anew(before, study)
        path.write_text(text.replace(before, after))
        pairs = list(zip(re.findall(NUMBERS, before), re.findall(NUMBERS, after), strict=True))
        changed = [(one, two) for one, two in pairs if one != two]
        sys.stdout.write(f"{page}: {len(changed)} of {len(pairs)} are other numbers now\n")
        for one, two in changed:
            sys.stdout.write(f"  {one} -> {two}\n")
    path = ROOT / "docs/paper-length.md"
    path.write_text(
        re.sub(r"\| \| early area .*?(?=\n\n)", lambda _: long_table(), path.read_text(), flags=re.S)
    )


if __name__ == "__main__":
    main()
