"""How often question 1 of the second study finds a gain, simulated before its runs."""

from __future__ import annotations

import numpy as np
import pandas as pd
from scipy import stats

from ship_trl.config.arm import SCRATCH
from ship_trl.run.console import show
from studies.runs import read_runs
from studies.second.answers import LEVEL, MARGIN, Sample
from studies.second.plan import ARMS, PAIRS, SIZES
from studies.sources.plan import FOLDER

DRAWS, SEED = 2000, 2022


def show_power(setting: str, markdown: bool) -> None:
    """Print how often a contrast of question 1 is found, after Bonferroni's correction.

    Samples are drawn from the residuals of the runs of the study of sources: from scratch, and of its arms.
    """
    sizes, generator = SIZES[setting], np.random.default_rng(SEED)
    kept = read_runs(FOLDER / setting, (), f"python -m studies.sources run {setting}")
    level = LEVEL / (len(PAIRS) * (len(ARMS) + 2))
    cells = []
    for pair, (source, target) in PAIRS.items():
        areas = residuals(kept, target, "", SCRATCH.name)
        could = 1 - float(np.mean(areas[0]))
        for arm in kept.loc[kept["source"] != "", "arm"].unique():
            _, spread = residuals(kept, target, source, arm)
            powers = [
                power(areas[1], spread, share * could, (sizes.scratch, sizes.arm), level, generator)
                for share in (0.0, MARGIN, 0.5)
            ]
            cells.append((pair, arm, f"{could:.2f}", *(f"{one:.2f}" for one in powers)))
    show(("pair", "arm", "could be gained", "nothing", "the margin", "half of it"), cells, markdown)


def residuals(kept: pd.DataFrame, target: str, source: str, arm: str) -> tuple[Sample, Sample]:
    """Return the areas of the study of sources, and residuals with the sample's standard deviation."""
    is_own = (kept["target"] == target) & (kept["source"] == source) & (kept["arm"] == arm)
    areas = kept.loc[is_own & (kept["length"] == kept["length"].min()), "area"].to_numpy()
    return areas, (areas - areas.mean()) * np.sqrt(len(areas) / (len(areas) - 1))


def power(
    base: Sample,
    spread: Sample,
    gain: float,
    sizes: tuple[int, int],
    level: float,
    generator: np.random.Generator,
) -> float:
    """Return the share of simulated studies whose Welch test finds the gain."""
    one = generator.choice(spread, (DRAWS, sizes[1])) + gain
    other = generator.choice(base, (DRAWS, sizes[0]))
    found = stats.ttest_ind(one, other, axis=1, equal_var=False)
    return float(np.mean((found.pvalue <= level) & ((found.statistic > 0) | (gain == 0.0))))
