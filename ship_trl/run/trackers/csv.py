"""Write `curve.csv`, one line per event, flushed at once; every run has it."""

from __future__ import annotations

import csv

from ship_trl.files.curve import COLUMNS, CURVE, Row
from ship_trl.files.disk import writing
from ship_trl.files.record import RunRecord
from ship_trl.run.plan import Run


class CsvTracker:
    """Writes rows; floats keep all digits, so that equal runs give equal bytes."""

    def __init__(self, run: Run) -> None:
        self._path = run.folder / CURVE

    def begin(self) -> None:
        """Write the header."""
        self._file = self._path.open("w", newline="")
        self._lines = csv.DictWriter(self._file, COLUMNS, restval="", lineterminator="\n")
        self._lines.writeheader()

    def log(self, row: Row) -> None:
        """Write a row."""
        with writing(self._path):
            self._lines.writerow(row)
            self._file.flush()

    def finish(self, result: RunRecord) -> None:
        """Do nothing, as `result.json` holds the result."""

    def close(self, failed: bool) -> None:
        """Close the file."""
        with writing(self._path):
            self._file.close()


start = CsvTracker
