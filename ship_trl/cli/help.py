"""The help of the whole command line; it imports no large library, so that it is quick."""

from __future__ import annotations

from ship_trl.config.paths import group_names, module_names

HELP_FLAGS = {"--help", "-h"}
# Each verb is a module of `ship_trl.cli` with a function `main`.
VERBS = {
    "watch": "roll out policies in a window",
    "record": "record policies as GIF, MP4, PNG frames or a chart of paths; no screen needed",
    "play": "steer a ship yourself",
    "evaluate": "evaluate policies: networks, random, the planner, your own",
    "exam": "find where policies fail: a map of all encounters with one ship, and an adversary",
    "cases": "list the cases and their similarity, and recommend a source for a target",
    "results": "tables and curves of finished runs, and metrics of transfer from any library's logs",
    "explain": "explain what a network has learned to see, on one page",
    "export": "export a network as an ONNX file",
    "study": "run a study, report it, ask it any contrast, keep its tables, compare its layers",
    "pretrain": "train the bundled networks again",
}

HELP = """\
ship_trl: transfer reinforcement learning in ship collision avoidance.

  python -m ship_trl +pair=high method=finetune layers=3
  python -m ship_trl source=3 target=2 method=feature_extraction layers=2
  python -m ship_trl target=4 method=scratch seed=1
  python -m ship_trl -m +pair=high,low +arm=scratch,FE3,FT3,FTW seed=0,1,2

What to run
  +pair=NAME            {pairs}; or any two cases:
  source=CASE           {cases}, or a YAML file
  target=CASE           the same; both may be a suite: {suites}
  method=METHOD         scratch, {methods} (default finetune);
                        settings: transfer.guide.belief=0.6 and others
  layers=N              1 to 4 layers (as many as the network has), all, head or body
  arm=NAME              method and layers at once: scratch, FE3, FT3, FTW, FEH, SP3, G, FE3-random ...
  source_file=FILE      take the source network from a safetensors file
  source=pretrained     the bundled network of the pair's source, or of the most similar case
  source_weights=NAME   learned; controls: random (untrained), permuted (learned, then shuffled)
  demonstrations=FOLDER preload the replay with recorded episodes (docs/tools.md)
  seed=N                0 by default

How
  profile=NAME          {profiles} (default quick)
  learn.KEY=VALUE       any value of the recipe, conf/recipe/<algorithm>_<profile>, as learn.episodes=1000
  algorithm=NAME        {algorithms} (default double_dqn), with keys of their own, as algorithm.steps=3
  observation=NAME      pixels (default) or vector: the scene as numbers, with network=vector
  network=NAME          {networks} (default paper)
  device=cpu|cuda       colour=true|false fast=true|false (false: torch alone, no compiled loops)
  logger=NAME           {trackers}, or all (csv is always written)
                        wandb.mode=offline|online wandb.project=NAME wandb.entity=NAME
  output=FOLDER         results go to FOLDER/<pair>/<arm>/seed=<k>
  overwrite=true        replace a finished run of other settings there, or a damaged one
  extend=true           go on from the finished run there, with learn.episodes=N more than it has

  -m, --multirun        a grid: values separated by commas
  +sweep=NAME           search for good settings with Optuna: {sweeps}
  objective=NAME        what a sweep maximises: late (greedy return after exploration), final, best
  --cfg job             print the configuration and stop
  --hydra-help          what Hydra adds

Verbs: python -m ship_trl VERB --help, or ship-trl VERB --help. Words and codes: docs/glossary.md
{verbs}
"""


def print_help() -> None:
    """Print the help."""
    groups = ("pair", "case", "suite", "profile", "algorithm", "network", "sweep")
    verbs = "\n".join(f"  {verb:<22}{what}" for verb, what in VERBS.items())
    names = {f"{group}s": group_names(group) for group in groups}
    names["methods"] = ", ".join(name for name in module_names("transfer/methods") if name != "base")
    names["trackers"] = ", ".join(module_names("run/trackers"))
    print(HELP.format(**names, verbs=verbs), end="")
