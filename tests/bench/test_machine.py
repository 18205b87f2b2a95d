"""Peaks are measured, and of the right size: bytes and operations are counted once."""

import torch

from ship_trl.bench.machine import copy, product, survey
from ship_trl.run.process import processor_name


def test_units_are_counted() -> None:
    assert product(8, torch.float32)() == 2 * 8**3
    assert copy(100)() == 200


def test_survey_measures_everything() -> None:
    machine = survey(rounds=1, seconds=0.001, size=64, copy_bytes=1 << 16)
    assert min(machine.fp32, machine.bf16, machine.copy) > 0
    assert machine.peak("fp32") == machine.fp32 * 1e9 and machine.peak("bf16") == machine.bf16 * 1e9
    assert machine.processor == processor_name() != ""
    assert machine.threads == torch.get_num_threads()
