"""Measure speed beside other libraries."""

from __future__ import annotations

import argparse
import os
import sys
from importlib import import_module
from importlib.util import find_spec

from ship_trl.cli.errors import refusals
from ship_trl.cli.parser import add_number, make_parser
from ship_trl.config.bounds import Positive, PositiveShare
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
# With --device cuda, beside Stable-Baselines3 and beside ours without CUDA graphs.
GPU_PARTS = {
    "simulator": "Simulation and drawing of 84x84 pixels",
    "update": "One gradient step",
    "loop": "Training loop",
    "lockstep": "Training loops of many agents, batches of 32, an update every 3 steps",
}
# Parts with options of their own, each in a file of its name.
ALONE = {
    "curves": "Success over minutes of training beside Stable-Baselines3",
    "before": "This build beside an earlier one",
    "growth": "Time and memory against ships, environments, replay and agents",
}


def main(arguments: list[str] | None = None) -> None:
    """Run the parts, and print their tables."""
    # As `ship_trl.__main__` does.
    os.environ["MPLBACKEND"] = "agg"
    words = sys.argv[1:] if arguments is None else arguments
    if words and words[0] in ALONE:
        with refusals():
            require_peers()
            import_module(f"benchmarks.{words[0]}").main(words[1:])
        return
    parts = "\n".join(f"    {part:12} {title}" for part, title in (GPU_PARTS | PARTS).items())
    alone = "\n".join(f"    {part:12} {title}; see {part} --help" for part, title in ALONE.items())
    parser = make_parser("", f"{__doc__}\n\nParts:\n{parts}\n{alone}")
    parser.prog = "python -m benchmarks"
    parser.add_argument("parts", nargs="*", metavar="PART", help="default: all")
    parser.add_argument("--device", choices=("cpu", "cuda"), default="cpu", help="default cpu")
    add_number(parser, "--rounds", Positive, 5, "passes over the probes of a part (default 5)")
    add_number(parser, "--seconds", PositiveShare, 1.0, "for a probe in a round, at most 1 (default 1)")
    parser.add_argument("--markdown", action="store_true", help="print Markdown tables")
    options = parser.parse_args(words)
    with refusals():
        allowed = PARTS if options.device == "cpu" else GPU_PARTS
        for part in options.parts:
            if part not in allowed:
                raise ConfigError(f"benchmarks: no part {part}; allowed: {', '.join(allowed)}")
        require_peers()
        bfloat16_allowed()
        run(options, allowed)


def require_peers() -> None:
    """Raise a ConfigError if Stable-Baselines3 is missing."""
    if find_spec("stable_baselines3") is None:
        raise ConfigError(
            "benchmarks: stable_baselines3 is missing; allowed: pip install -e '.[bench]' first"
        )


def run(options: argparse.Namespace, titles: dict[str, str]) -> None:
    """Measure one part after the other."""
    # After the checks: torch takes seconds to import.
    import torch

    from benchmarks import learning, simulator, sizes
    from benchmarks.timing import measure, print_table
    from ship_trl.run.process import configure_process, processor_name

    device, is_gpu = options.device, options.device == "cuda"
    if is_gpu and not torch.cuda.is_available():
        raise ConfigError("--device: no CUDA device is available here; allowed: cpu")
    configure_process()
    machine = torch.cuda.get_device_name() if is_gpu else processor_name()
    sys.stdout.write(f"{machine}, torch {torch.__version__}, {torch.get_num_threads()} thread\n")
    for part in options.parts or titles:
        if part == "memory":
            found = sizes.measure_memory()
        elif part == "checkpoints":
            found = sizes.measure_checkpoints(options.rounds, options.seconds)
        else:
            make = simulator.probes if part == "simulator" else learning.PROBES[part]
            finish = torch.cuda.synchronize if is_gpu else lambda: None
            found = measure(make(device), options.rounds, options.seconds, finish)
        print_table(titles[part], found, options.markdown)
        if is_gpu:
            most = torch.cuda.max_memory_allocated() / 2**30
            sys.stdout.write(f"at most {most:.2f} GiB of GPU memory\n")
            torch.cuda.reset_peak_memory_stats()


if __name__ == "__main__":
    main()
