"""Two studies with their reports, for all tests that read them."""

import csv
import io
import json
import shutil
from contextlib import redirect_stderr, redirect_stdout
from dataclasses import dataclass
from pathlib import Path

import pytest

from ship_trl.study.report import write
from tests.command import report as main
from tests.study.synthetic import write_study

MARKUP = "<img src=x onerror=alert(1)>"
# Files of an earlier report that go, and files that stay.
GONE, STAYING = ["pair_low.png", "pair_low.pdf", "reuse.png", "forest_3.pdf"], ["mine.png", "pair_low.txt"]
# From the worst to the best: claims H5d and H5k hold, and H5e is open.
ARMS = ("FT1", "FE2", "scratch", "FE1", "FT2", "FTW")
FEW = ("scratch", "FE1")


@dataclass(frozen=True)
class Reported:
    """A study's folder with its report, and what the report printed."""

    folder: Path
    out: str
    err: str

    def read(self, name: str) -> str:
        return (self.folder / "report" / name).read_text()

    def rows(self, name: str) -> list[dict[str, str]]:
        return list(csv.DictReader(io.StringIO(self.read(f"{name}.csv"))))

    def claims(self) -> dict[str, list[dict[str, str]]]:
        """The rows of each claim."""
        found: dict[str, list[dict[str, str]]] = {}
        for row in self.rows("claims"):
            found.setdefault(row["claim"], []).append(row)
        return found


def report(folder: Path) -> Reported:
    with redirect_stdout(io.StringIO()) as out, redirect_stderr(io.StringIO()) as err:
        main([str(folder)])
    return Reported(folder, out.getvalue(), err.getvalue())


@pytest.fixture(scope="package")
def reported(tmp_path_factory: pytest.TempPathFactory) -> Reported:
    folder = tmp_path_factory.mktemp("study")
    write_study(folder, 5, arms=ARMS, noise=0.03)
    return report(folder)


@pytest.fixture(scope="package")
def odd(tmp_path_factory: pytest.TempPathFactory) -> Reported:
    """Seven planned seeds of two arms: the sixth is broken in parts, and the seventh has no run."""
    folder = tmp_path_factory.mktemp("odd")
    write_study(folder, 6, arms=FEW)
    place = folder / "pairs/high"
    (place / "FE1/seed=5/curve.csv").write_text("episode")
    shutil.copytree(place / "FE1/seed=0", folder / "pairs_old/high/FE1/seed=0")
    (folder / "pairs" / MARKUP / "scratch/seed=0").mkdir(parents=True)
    for seed, precision in ((0, "bfloat16"), (1, "float32")):
        path = place / f"FE1/seed={seed}/result.json"
        path.write_text(json.dumps(json.loads(path.read_text()) | {"precision": precision, "device": "cpu"}))
    jobs = [
        {"name": "", "stage": 0, "part": "pairs", "label": "high", "arm": arm, "seed": seed}
        for arm in FEW
        for seed in range(7)
    ]
    (folder / "study.json").write_text(json.dumps({"settings": {}, "cases": {}, "jobs": jobs}))
    with (folder / "earlier.csv").open("w", newline="") as file:
        rows = [("H5a", "contradicted", "Other words | <b>"), ("OLD", "supported", "")]
        csv.writer(file).writerows([("claim", "claim's verdict", "sentence"), *rows])
    (folder / "report").mkdir()
    for name in [*GONE, *STAYING]:
        (folder / "report" / name).touch()
    drawings = write.drawings
    with pytest.MonkeyPatch.context() as patch:  # each takes a second
        patch.setattr(
            write, "drawings", lambda study: {key: drawings(study)[key] for key in ("pair_high", "times")}
        )
        return report(folder)
