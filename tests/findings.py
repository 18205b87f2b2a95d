"""`python -m tests.findings`: write the numbers of docs/findings.md from the kept tables; check README.md.

The page names a contrast in the words of `ship_trl study ask`, followed by its numbers, also across lines:

    `high: FTW above scratch (area)` +0.06 (+0.02 to +0.11; greedy +0.17)

In a table the heading may say where and the first cell what: `FTW above scratch (area)`. The command rewrites
these numbers with as many decimals as the page has, and prints the facts that are not there.
"""

from __future__ import annotations

import re
import sys

import numpy as np
import pandas as pd
import yaml
from scipy.stats import norm

from ship_trl.cli.study import answers
from ship_trl.study.report.gains import measure_forests
from ship_trl.study.study import Study, read_study
from studies.paper.claims import claims as paper_claims
from studies.paper.judge import Grade
from tests.command import ROOT
from tests.studies.paper.test_confirmatory import FOLDER, REPORT, SEEN

PAGE, README = ROOT / "docs/findings.md", ROOT / "README.md"
LONG = ROOT / "outputs/paper_high"
PAIRS = {"high": "2", "low": "4", "lowest": "6"}
ARMS = [f"{kind}{n}" for kind in ("FE", "FT") for n in (1, 2, 3, 4)] + ["FTW"]
WORDS = ("none", "one", "two", "three", "four", "five", "six")
NUMBER = r"[+-]\d+\.\d+"
NUMBERS = rf"{NUMBER}\s+\({NUMBER}\s+to\s+{NUMBER}(?:;\s+greedy\s+{NUMBER})?\)"
# A claim is told by the seeds of the look that decided it.
INLINE = re.compile(rf"`([^`:]+:\s[^`]+)`(?:\s+on\s+the\s+first\s+(\d+)\s+seeds)?\s+({NUMBERS})")


def rewrite(text: str, study: Study) -> str:
    """Return a text with all numbers of contrasts computed again."""
    text = INLINE.sub(lambda m: m[0].replace(m[3], measure(m[1], m[3], study, int(m[2] or SEEN))), text)
    head: list[str] = []
    lines = []
    for line in text.split("\n"):
        cells = line.split("|")
        head = [] if len(cells) < 3 else head or [cell.strip() for cell in cells]
        what = re.fullmatch(r" `([^`:]+)` ", cells[1]) if len(cells) == len(head) else None
        for place in range(2, len(cells) - 1) if what else ():
            if found := re.search(NUMBERS, cells[place]):
                numbers = measure(f"{head[place]}: {what[1]}", found[0], study) if what else ""
                cells[place] = cells[place].replace(found[0], numbers)
        lines.append("|".join(cells))
    return "\n".join(lines)


def measure(question: str, numbers: str, study: Study, seeds: int = SEEN) -> str:
    """Return the numbers of one contrast, in the form and with the decimals of `numbers`."""
    (one,) = answers(study, [" ".join(question.split())], seeds)
    greedy = [beside.value for name, beside in one.beside.items() if name.startswith("greedy")]
    values = iter([one.value, one.low, one.high, *greedy])
    return re.sub(NUMBER, lambda m: f"{next(values):+.{len(m[0].partition('.')[2])}f}", numbers)


def claims() -> pd.DataFrame:
    """Return the contrasts of the paper's claims, a row each."""
    rows = pd.read_csv(REPORT / "claims.csv")
    return rows[rows["claim"].str.match("[CH]")]


def verdicts() -> str:
    """Return the words that say how many claims have which verdict."""
    found = claims().groupby("claim")["claim's verdict"].first()
    held, refuted = (WORDS[(found == verdict).sum()] for verdict in ("supported", "contradicted"))
    undecided = (found == "inconclusive").sum()
    return (
        f"{held} of the paper's {len(found)} claims hold, {undecided} are undecided and {refuted} is refuted"
    )


def held() -> list[str]:
    """Return the first cells of the table of claims that hold."""
    rows = claims()
    return [f"| {name} |" for name in rows.loc[rows["claim's verdict"] == "supported", "claim"].unique()]


def facts(study: Study) -> list[str]:
    """Return the sentences of docs/findings.md that count something, from the tables."""
    return [
        verdicts(),
        *held(),
        *of_claims(),
        *of_runs(),
        *of_arms(study),
        *of_forests(study),
        *of_layers(),
        at_length(),
        *of_second_study(),
    ]


def of_grades() -> list[str]:
    """Return the rows of the table of grades: each claim with its parts, the undetermined ones in one row."""
    rows, told = claims(), []
    for grade in Grade:
        own = [(name, parts) for name, parts in rows[rows["grade"] == grade.value].groupby("claim")]
        if grade is Grade.undetermined:
            cells = ["; ".join(f"{name} ({count_parts(parts)})" for name, parts in own) + " |"]
        else:
            cells = [f"{name}: {parts['sentence'].iloc[0]} | {count_parts(parts)}" for name, parts in own]
        firsts = [f"{grade.value} ({len(own)})", *[""] * (len(cells) - 1)]
        told += [
            f"| {first} | {cell} |".replace("|  |", "| |")
            for first, cell in zip(firsts, cells or ["none |"], strict=True)
        ]
    return told


def count_parts(parts: pd.DataFrame) -> str:
    """Count a claim's parts that are for it, against it, whose size is excluded, and all."""
    counts = [(parts["part"] == part).sum() for part in ("for", "against", "size excluded")]
    return f"{', '.join(map(str, counts))} of {len(parts)}"


def of_claims() -> list[str]:
    """Return what is counted of claims: power, and the p of two."""
    rows = claims()
    power = rows["seen adjusted"].le(rows["margin"]).groupby(rows["claim"]).all()
    p = rows.groupby("claim")["claim's p"].first().map("{:.3f}".format)
    return [
        f"{'some' if power.any() else 'no'} claim had a power of 80 % at the margin in all of its contrasts",
        f"The p of C1 and of H9b are {' or '.join(sorted({p['C1'], p['H9b']}))};",
    ]


def of_runs() -> list[str]:
    """Return what is counted of runs: those that fell back."""
    runs = pd.read_csv(REPORT / "runs.csv")
    pairs, controls = runs[runs["part"] == "pairs"], runs[runs["part"] == "controls"]
    is_scratch = pairs["arm"] == "scratch"
    groups = (pairs[is_scratch], pairs[~is_scratch], controls)
    fell = [f"{group['fell'].sum():.0f} of {len(group)}" for group in groups]
    drawn = controls[controls["arm"].str.contains("random|permuted")]["fell"].sum()
    told = "{} runs from scratch, {} transfers of the pairs and {} controls".format(*fell)
    return [f"{told}, {drawn:.0f} of which have random or shuffled layers."]


def of_arms(study: Study) -> list[str]:
    """Return what is counted of arms: shares of what could be gained, and intervals above and below zero."""
    gains = yaml.safe_load((ROOT / "studies/paper/analysis.yaml").read_text())["gains"]

    def every(where: str, words: str) -> pd.DataFrame:
        found = answers(study, [f"{where}: {arm} {words}" for arm in ARMS], SEEN)
        ends = [[one.value, one.low, one.high] for one in found]
        return pd.DataFrame(ends, [f"{where} {arm}" for arm in ARMS], ["value", "low", "high"])

    area = pd.concat(every(pair, "above scratch (area)") for pair in PAIRS)
    time = pd.concat(every(pair, "sooner than scratch (time)") for pair in PAIRS)
    share = area["value"] / [gains[PAIRS[name.split()[0]]]["area"] for name in area.index]
    parts = area[~area.index.str.endswith("FTW")]
    above, below = (area["low"] > 0).sum(), (area["high"] < 0).sum()
    return [
        *(
            f"| could be gained: {metric} | {' | '.join(f'{gains[case][metric]:.3f}' for case in '246')} |"
            for metric in ("area", "time", "asymptote")
        ),
        f"No other of the {len(area)} arms gains more than {100 * share.max():.0f} %.",
        *(row_of(arm, [f"{100 * share[f'{pair} {arm}']:.0f} %" for pair in PAIRS]) for arm in ("FTW", "FE3")),
        f"In {WORDS[(time['low'] > 0).sum()]} of {len(time)} arms:",
        f"{above} of {len(area)} arms of the pairs gain area, {below} lose",
        f"of parts, {(parts['low'] > 0).sum()} of {len(parts)} gain.",
    ]


def of_forests(study: Study) -> list[str]:
    """Return what FTW gains in greedy returns, and whose interval alone lies above the margin's share."""
    forests = measure_forests(study)
    margin = study.claims.margin or 0.0
    alone = set.intersection(
        *({arm for arm, one in forest.gains.items() if one.low > margin} for forest in forests)
    )
    questions = [f"{pair}: FTW above {arm} (greedy area)" for pair in PAIRS for arm in ARMS[:-1]]
    beaten = sum(one.low > 0 for one in answers(study, questions, SEEN))
    whose = "Only its interval lies" if alone == {"FTW"} else "Not only its interval lies"
    return [
        row_of(
            "the whole network (FTW)", "first, pixels", [f"{share:.0f} %" for share in whole_shares(study)]
        ),
        f"{whose} above a fifth of the gap in every pair.",
        f"FTW is {'' if beaten == len(questions) else 'not '}above each of the other arms in every pair.",
    ]


def whole_shares(study: Study) -> list[float]:
    """Return the share of the gap (%) that FTW closes in greedy returns, by pair."""
    return [100 * forest.gains["FTW"].value for forest in measure_forests(study)]


def row_of(*cells: str | list[str]) -> str:
    """Write a row of a table."""
    flat = [text for cell in cells for text in ([cell] if isinstance(cell, str) else cell)]
    return f"| {' | '.join(flat)} |".replace("|  |", "| |")


def of_layers() -> list[str]:
    """Return how similar the layers of scratch are to others: rows of CKA, the range over the pairs."""
    table = pd.read_csv(REPORT / "cka.csv")
    table = table[(table["arm"] == "scratch") & table["layer"].isin(["conv3", "conv4", "shared"])]
    table = table[table["pair"].isin(PAIRS)]
    ends = table.groupby(["beside", "layer"])["cka"].agg(["min", "max"])
    cells = ends.apply(lambda row: f"{row['min']:.2f} to {row['max']:.2f}", axis=1).unstack()
    return [f"| {beside} | {' | '.join(cells.loc[beside])} |" for beside in cells.index]


def at_length() -> str:
    """Return how many seeds of the study at the paper's length are done."""
    study = read_study(LONG)
    return f"{len({key[3] for key in study.records})} of {len(study.seeds)} seeds are done"


def share_of(rows: pd.DataFrame, question: int, where: str, arm: str) -> str:
    """Return the share of the gap that an arm closes, in an answer of the second study."""
    is_asked = (rows["question"] == question) & (rows["where"] == where)
    (one,) = rows[is_asked & rows["what"].str.match(f"{arm} .*less scratch")].to_dict("records")
    return f"{100 * one['value'] / one['possible_gain']:.0f} %"


def of_second_study() -> list[str]:
    """Return what the second study says: shares of what could be gained, and where its halves agree."""
    numbers, pixels = (
        pd.read_csv(ROOT / f"outputs/questions/{setting}_answers.csv") for setting in ("numbers", "pixels")
    )

    first, tuned, seen = (
        [share_of(rows, number, pair, "FTW") for pair in PAIRS]
        for rows, number in ((numbers, 1), (numbers, 6), (pixels, 1))
    )
    both = numbers.merge(pixels, on=["question", "where", "what"])
    gains = both[(both["question"] == 1) & both["what"].str.endswith("less scratch")]
    errors = [(gains[f"high_{side}"] - gains[f"low_{side}"]) / (2 * 1.96) for side in "xy"]
    apart = (gains["value_x"] - gains["value_y"]).abs() / np.hypot(*errors)
    beyond = (apart > norm.ppf(1 - 0.025 / len(gains))).sum()
    return [
        row_of("", "second, pixels", seen),
        row_of("", "second, numbers", first),
        row_of("", "second, numbers, each arm with its best of six learners", tuned),
        row_of(
            "three frozen layers (FE3)",
            "second, pixels",
            ["open", *(share_of(pixels, 1, pair, "FE3") for pair in ("low", "lowest"))],
        ),
        row_of("", "second, numbers", ["below scratch", "level", share_of(numbers, 1, "lowest", "FE3")]),
        f"closes {share_of(numbers, 3, 'imazu', 'FTW')} of the gap |",
        f"(FE3) | closes {share_of(numbers, 3, 'imazu', 'FE3')} |",
        f"{beyond} of {len(gains)} gains over scratch are further apart than chance allows.",
    ]


def of_readme(study: Study) -> list[str]:
    """Return what the README says was found."""
    high, low, lowest = whole_shares(study)
    rows = pd.read_csv(ROOT / "outputs/questions/numbers_answers.csv")
    return [
        verdicts(),
        f"closes {high:.0f}, {low:.0f} and {lowest:.0f} % of the gap",
        f"closes {share_of(rows, 3, 'imazu', 'FTW')} of the gap on the Imazu problems",
    ]


def lacking(study: Study) -> list[str]:
    """Return the facts that the pages lack."""
    pages = ((PAGE, facts(study)), (README, of_readme(study)))
    texts = {page: " ".join(page.read_text().split()) for page, _ in pages}
    return [f"{page.name} lacks: {fact}" for page, some in pages for fact in some if fact not in texts[page]]


def main() -> None:
    """Rewrite the numbers of contrasts, and print the facts that the pages lack."""
    study = read_study(FOLDER, paper_claims())
    before = PAGE.read_text()
    after = rewrite(before, study)
    PAGE.write_text(after)
    pairs = zip(re.findall(NUMBERS, before), re.findall(NUMBERS, after), strict=True)
    changed = [f"{one} -> {two}" for one, two in pairs if one != two]
    sys.stdout.write(
        "\n".join([f"{PAGE.name}: {len(changed)} numbers changed", *changed, *lacking(study), ""])
    )


if __name__ == "__main__":
    main()
