# %% [markdown]
# # Transfer in ten minutes
#
# Does a network learn faster if it begins with what another one learned? In case 3 a ship crosses from
# starboard. In case 4 a second one follows it. The network of case 3 is the *source*; case 4 is the
# *target*. Together they are the pair `low`.
#
# Compared are two arms: `scratch` begins with random weights, and `FT3` (finetuning, three layers) begins
# with the source's first three layers and trains all of them on. Networks here see numbers; a run takes
# about a minute. From pixels (leave `observation=vector` out) it takes some minutes.
#
# ## Train one run
#
# In a shell this is `ship-trl +pair=low arm=FT3 observation=vector ...`. The same words make a run in
# Python. The source is missing, so it is trained first, once.

# %%
from ship_trl.files.record import RunRecord
from ship_trl.grid.compose import compose_config
from ship_trl.run.experiment import run_experiment
from ship_trl.run.plan import make_run

EPISODES = 200
FOLDER = "outputs/lessons/transfer"


def train(arm: str, seed: int) -> RunRecord:
    """Train one run, or read it where it is finished."""
    words = ["+pair=low", f"arm={arm}", f"seed={seed}", "observation=vector"]
    return run_experiment(make_run(compose_config(*words, f"learn.episodes={EPISODES}", f"output={FOLDER}")))


first = train("FT3", seed=0)

# %% [markdown]
# The folder `outputs/lessons/transfer/low/FT3/seed=0` has the network, the learning curve (`curve.csv`,
# `curve.png`) and a film of the best episode. The same cell run again trains nothing: a finished run is
# read.
#
# ## Compare it with learning from scratch
#
# Each arm gets the same seeds. One is enough to see how it works, and too few to decide anything: give more.

# %%
SEEDS = (0,)
runs = {arm: [train(arm, seed) for seed in SEEDS] for arm in ("scratch", "FT3")}

# %% [markdown]
# ## Measure the gain
#
# A score of 0 is the mean return of random actions, 1 the best known return. The *greedy area* is the mean
# score of all greedy evaluations, so it is high if a run learns fast and learns well. What FT3 has more of
# it than scratch is the gain of the transfer.

# %%
from ship_trl.study.metrics import measure

for arm, found in runs.items():
    areas = ", ".join(f"{measure(run, 'greedy area'):.2f}" for run in found)
    best = ", ".join(f"{run.best.episode_return:.1f} ({run.best.outcome})" for run in found)
    print(f"{arm}: greedy area {areas}; best return {best}")

# %% [markdown]
# ## See the curves

# %%
from ship_trl.cli.results import main as results

results([FOLDER, "--picture", "outputs/lessons/curves.png"])

# %% [markdown]
# Training episodes are above, greedy evaluations below; the source is at the left.
#
# ![Returns of the source, and of both arms, along the training](pictures/curves.png)
#
# With seed 0 the best return of FT3 is 18.1, that of scratch 2.0; both reach the goal. But the greedy area of
# scratch is larger, 0.36 against 0.19: of one seed the two measures may disagree, and neither decides.
#
# ## Go on
#
# - Frozen layers are `arm=FE3`, the whole network is `arm=FTW`; [more methods](../../docs/transfer.md).
# - `ship-trl cases target=4` ranks sources for a target by the gain to expect, and recommends one.
# - `ship-trl study run` trains a grid of arms and seeds, and writes a report with intervals
#   ([a study](../../docs/study.md)); [findings](../../docs/findings.md) has what 15 seeds showed.
