"""The parts of the benchmark: which probes, and what is said of them."""

from __future__ import annotations

import statistics
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from ship_trl.bench import cores, footprint, learning, report, simulator
from ship_trl.bench.machine import Machine
from ship_trl.bench.timing import Probe, measure
from ship_trl.bench.work import CASE, learn_config


@dataclass(frozen=True)
class Plan:
    """How a part is run and shown."""

    rounds: int
    seconds: float
    markdown: bool
    machine: Machine


def run_part(name: str, plan: Plan) -> list[Any]:
    """Run a part, print its table, and return its results, one for each line of JSON."""
    return PARTS[name](name, plan)


def timed(title: str, probes: Callable[[], list[Probe]]) -> Callable[[str, Plan], list[Any]]:
    """Make a part of probes that need nothing."""
    return lambda part, plan: show(part, title, probes(), plan)


def beside_peers(title: str, probes: Callable[[simulator.MakeEnv], list[Probe]]) -> Callable[..., list[Any]]:
    """Make a part whose peers learn on the quicker of the two Gymnasium environments."""

    def run(part: str, plan: Plan) -> list[Any]:
        make_env, said = simulator.faster_env(CASE, learn_config().reward_scale)
        found = show(part, title, probes(make_env), plan)
        report.say(said)
        return found

    return run


def show(part: str, title: str, probes: list[Probe], plan: Plan) -> list[Any]:
    """Time probes and print their table."""
    timings = measure(probes, plan.rounds, plan.seconds)
    found: list[Any] = report.rows(part, timings, plan.machine)
    report.show(title, report.COLUMNS, [row.cells() for row in found], plan.markdown)
    if any(row.of_peak is not None for row in found):
        report.say("Of peak: operations on whole pictures; ours leaves out those on what stays still.")
    if part == "update":
        times = learning.overhead(timings)
        report.say(f"Our whole loop takes {times:.2f} times its bare updates.")
        found.append({"part": part, "name": "loop in bare updates", "median": times})
    return found


def memory(part: str, plan: Plan) -> list[Any]:
    """Bytes of replays, and of a whole run."""
    held = footprint.replay_memory()
    ours = next(iter(held.values()))
    lines = [[name, f"{size / 1e6:,.1f} MB", f"{size / ours:,.0f}x"] for name, size in held.items()]
    title = f"Memory of a replay of {footprint.TRANSITIONS:,} transitions"
    report.show(title, ("name", "memory", "of ours"), lines, plan.markdown)
    resident = footprint.run_memory(footprint.EPISODES)
    report.say(
        f"A run of the profile quick has at most {resident / 2**30:.2f} GiB resident, libraries included."
    )
    held["ours, a whole run"] = resident
    return [{"part": part, "name": name, "unit": "byte", "median": size} for name, size in held.items()]


def processes(part: str, plan: Plan) -> list[Any]:
    """Trainings side by side, one a core."""
    rates = cores.growth_with_cores(plan.rounds, max(plan.seconds, cores.LEAST_SECONDS))
    times = cores.gains(rates)
    lines = [
        [str(count), report.number(statistics.median(found)), f"{times[count]:.2f}x"]
        for count, found in rates.items()
    ]
    report.show("Trainings side by side", ("processes", "steps per s", "of one"), lines, plan.markdown)
    return [
        {"part": part, "name": f"{count} processes", "unit": "step", "rates": found, "of_one": times[count]}
        for count, found in rates.items()
    ]


def growth(part: str, plan: Plan) -> list[Any]:
    """Ships, environments, batch size."""
    ships = show(part, "Growth with target ships, drawn", simulator.ship_probes(), plan)
    return ships + show(part, "Growth with environments and batch", learning.growth_probes(), plan)


PARTS: dict[str, Callable[[str, Plan], list[Any]]] = {
    "simulator": timed("Simulation and drawing of 84x84 pixels", simulator.simulator_probes),
    "replay": beside_peers("A batch from the replay", learning.replay_probes),
    "update": beside_peers("One update, and acting", learning.update_probes),
    "loop": beside_peers("Whole training loop", learning.loop_probes),
    "frozen": beside_peers("Whole training loop with frozen layers", learning.frozen_probes),
    "memory": memory,
    "cores": processes,
    "startup": timed("Start of Python", footprint.startup_probes),
    "growth": growth,
}
