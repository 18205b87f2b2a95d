"""Measure speed beside other libraries."""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path

from benchmarks import curves, encounters, gpu
from benchmarks.work import require_peers
from ship_trl.cli.errors import refusals
from ship_trl.cli.parser import make_parser
from ship_trl.config.errors import ConfigError
from ship_trl.config.types import bfloat16_allowed

PARTS = {
    "loop": "Training loop beside Stable-Baselines3, TorchRL's usual way and tuned PyTorch",
    "update": "One gradient step of each",
    "frozen": "Training loop with frozen layers",
    "vector": "Training loop on numbers in place of pixels, 64 environments, batches of 128",
    "simulator": "Simulation and drawing of 84x84 pixels beside pygame",
    "memory": "Memory of a replay beside Stable-Baselines3's, and of a whole run",
    "checkpoints": "Checkpoints of a run of the paper's length, replay full",
}
# Not part of all: they have arguments of their own.
ALONE = {
    "encounters": ("What policies do in suites of encounters", encounters.main),
    "curves": ("Success over minutes of training beside Stable-Baselines3", curves.main),
    "gpu": ("Simulation, updates and training loops on a GPU", gpu.main),
}


def main(arguments: list[str] | None = None) -> None:
    """Run the parts, print their tables, and write the JSON file if one is asked for."""
    # As `ship_trl.__main__` does.
    os.environ["MPLBACKEND"] = "agg"
    words = sys.argv[1:] if arguments is None else arguments
    if words and words[0] in ALONE:
        ALONE[words[0]][1](words[1:])
        return
    alone = {part: f"{title}; see {part} --help" for part, (title, _) in ALONE.items()}
    parts = "\n".join(f"    {part:12} {title}" for part, title in (PARTS | alone).items())
    parser = make_parser("benchmarks", f"{__doc__}\n\nParts:\n{parts}")
    parser.prog = "python -m benchmarks"
    parser.add_argument("parts", nargs="*", metavar="PART", help="default: all")
    parser.add_argument("--rounds", type=int, default=5, help="passes over the probes of a part (default 5)")
    parser.add_argument("--seconds", type=float, default=2.0, help="for a probe in a round (default 2)")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write every value there")
    parser.add_argument("--markdown", action="store_true", help="print Markdown tables")
    options = parser.parse_args(words)
    with refusals():
        check(options)
        run(options)


def check(options: argparse.Namespace) -> None:
    """Check the options and what must be installed.

    Raises:
        ConfigError: an option is out of range, its folder or a library is missing.
    """
    for part in options.parts:
        if part not in PARTS:
            raise ConfigError(f"benchmarks: no part {part}; allowed: {', '.join([*PARTS, *ALONE])}")
    if options.rounds < 1:
        raise ConfigError(f"--rounds: must be at least 1, got {options.rounds}")
    if not options.seconds > 0:
        raise ConfigError(f"--seconds: must be above 0, got {options.seconds}")
    if options.json is not None and not options.json.absolute().parent.is_dir():
        raise ConfigError(f"--json: no folder {options.json.absolute().parent}")
    require_peers()
    bfloat16_allowed()


def run(options: argparse.Namespace) -> None:
    """Measure one part after the other."""
    # After the checks: torch takes seconds to import.
    import torch
    from rich.console import Console

    from benchmarks import checkpoints, learning, memory, simulator
    from benchmarks.table import compare, print_table, write_json
    from benchmarks.timing import Measurement, measure
    from ship_trl.run.process import configure_process, processor_name

    probes = {
        "loop": learning.loop_probes,
        "update": learning.update_probes,
        "frozen": learning.frozen_probes,
        "vector": learning.vector_probes,
        "simulator": simulator.probes,
    }
    sizes: dict[str, Callable[[], list[Measurement]]] = {
        "memory": memory.measure_memory,
        "checkpoints": partial(checkpoints.measure_checkpoints, options.rounds, options.seconds),
    }
    configure_process()
    machine = f"{processor_name()}, torch {torch.__version__}, {torch.get_num_threads()} thread"
    Console(highlight=False).print(machine)
    rows = []
    for part in options.parts or PARTS:
        timed = part in probes
        found = measure(probes[part](), options.rounds, options.seconds) if timed else sizes[part]()
        compared = compare(part, found)
        print_table(PARTS[part], compared, options.markdown)
        rows += compared
    if options.json is not None:
        write_json(options.json, machine, rows)


if __name__ == "__main__":
    main()
