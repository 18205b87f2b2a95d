"""Read a study's runs in pandas: what each arm gains over scratch, seed by seed.

    python examples/study_in_pandas.py outputs/confirmatory/report/runs.csv

A row of `runs.csv` is a run, a column a metric (what it is: studies/paper/analysis-plan.md). Runs of one seed
share their source network, so differences are taken within a seed.
"""

import sys
from pathlib import Path

import pandas as pd


def gains(runs: pd.DataFrame, metric: str = "area") -> pd.DataFrame:
    """Return mean and standard error of an arm's difference from scratch, by pair and arm."""
    pairs = runs[runs["part"] == "pairs"]
    table = pairs.pivot_table(index=["pair", "seed"], columns="arm", values=metric)
    differences = table.sub(table["scratch"], axis=0).drop(columns="scratch")
    return differences.stack().groupby(level=["pair", "arm"]).agg(["mean", "sem"])


def main(path: Path) -> None:
    """Print the table of gains."""
    print(gains(pd.read_csv(path)).round(3).to_string())


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "outputs/confirmatory/report/runs.csv"))
