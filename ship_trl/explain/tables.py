"""The numbers behind the charts, as CSV files."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

import pandas as pd

from ship_trl.explain.bootstrap import Estimate
from ship_trl.explain.rows import Measured
from ship_trl.files.disk import atomic_write


def write_tables(output: Path, measured: Measured) -> None:
    """Write a CSV of each kind of measurement into a folder."""
    for name in ("probes", "cka", "erased", "filters"):
        with atomic_write(output / f"{name}.csv") as draft:
            pd.DataFrame(map(flatten, getattr(measured, name))).to_csv(draft, index=False)


def flatten(row: Any) -> dict[str, Any]:
    """Convert a row to columns; an estimate gives three."""
    values: dict[str, Any] = {}
    for field in dataclasses.fields(row):
        value = getattr(row, field.name)
        if isinstance(value, Estimate):
            ends = {f"{field.name}_low": value.low, f"{field.name}_high": value.high}
            values |= {field.name: value.value, **ends}
        else:
            values[field.name] = value
    return values
