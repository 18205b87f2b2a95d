"""Read the study of sources in pandas: what each source is worth to each target.

    python examples/sources_in_pandas.py outputs/sources/numbers.csv.xz FTW

A row of the table is a run: target, source (empty from scratch), arm, seed, length, and greedy returns at
equal distances with spaces between them, the first before training (studies/sources/README.md).
"""

import sys

import pandas as pd


def scores(runs: pd.DataFrame) -> pd.Series:
    """Return the mean score of each run over its evaluations: 0 is random or worse, 1 the best known."""
    greedy = runs["greedy"].str.split(expand=True).astype(float).iloc[:, 1:]
    scaled = greedy.sub(runs["random"], axis=0).div(runs["best_known"] - runs["random"], axis=0)
    return scaled.clip(lower=0).mean(axis=1)


def gains(runs: pd.DataFrame, arm: str) -> pd.DataFrame:
    """Return the mean gain over scratch by target and source, NaN where they are one case."""
    runs = runs.assign(score=scores(runs))
    transfers = runs[runs["arm"] == arm]
    # Runs that made a source are longer.
    scratch = runs[(runs["arm"] == "scratch") & runs["length"].isin(transfers["length"])]
    table = transfers.pivot_table(index="target", columns="source", values="score")
    return table.sub(scratch.groupby("target")["score"].mean(), axis=0)


def main(path: str, arm: str) -> None:
    """Print the best three sources of each target."""
    names = {"target": str, "source": str}
    table = gains(pd.read_csv(path, dtype=names, keep_default_na=False), arm)
    for target, row in table.iterrows():
        best = row.nlargest(3)
        print(f"{target}: " + ", ".join(f"{source} {gain:+.2f}" for source, gain in best.items()))


if __name__ == "__main__":
    given = sys.argv[1:]
    main(given[0] if given else "outputs/sources/numbers.csv.xz", given[1] if len(given) > 1 else "FTW")
