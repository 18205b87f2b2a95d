"""Two studies with their reports, for all tests that read them."""

import csv
import io
import json
import shutil
from contextlib import redirect_stderr, redirect_stdout
from dataclasses import dataclass
from pathlib import Path

import pytest

from ship_trl.cli.report import main
from ship_trl.study.claims.verdicts import ALL
from tests.study.synthetic import ARMS, write_study

MARKUP = "<img src=x onerror=alert(1)>"
# Files of an earlier report that go, and files that stay.
GONE, STAYING = ["pair_low.png", "pair_low.pdf", "reuse.png", "forest_3.pdf"], ["mine.png", "pair_low.txt"]


@pytest.fixture(scope="package")
def study(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("study")
    write_study(folder, seeds=5)
    main([str(folder)])
    return folder


@dataclass(frozen=True)
class Odd:
    """A study of which much is wrong: its folder, and what its report printed."""

    folder: Path
    out: str
    err: str

    def page(self) -> str:
        return (self.folder / "report/index.html").read_text()


@pytest.fixture(scope="package")
def odd(tmp_path_factory: pytest.TempPathFactory) -> Odd:
    """Seven planned seeds: the sixth is broken in parts, and the seventh has no run."""
    folder = tmp_path_factory.mktemp("odd")
    write_study(folder, seeds=6)
    place = folder / "pairs/high"
    (place / "FE1/seed=5/curve.csv").write_text("episode")
    (place / "FE2/seed=5/result.json").unlink()
    (place / "FTW/seed=5/result.json").write_text("{}")
    shutil.copytree(place / "FE3/seed=0", folder / "pairs_old/high/FE3/seed=0")
    (folder / "pairs" / MARKUP / "scratch/seed=0").mkdir(parents=True)
    for seed, precision in ((0, "bfloat16"), (1, "float32")):
        path = place / f"FE1/seed={seed}/result.json"
        path.write_text(json.dumps(json.loads(path.read_text()) | {"precision": precision, "device": "cpu"}))
    jobs = [
        {"name": "", "stage": 0, "part": "pairs", "label": "high", "arm": arm, "seed": seed}
        for arm in ARMS
        for seed in range(7)
    ]
    (folder / "study.json").write_text(json.dumps({"settings": {}, "cases": {}, "jobs": jobs}))
    (sentence,) = (claim.sentence for claim in ALL if claim.name == "H5a")
    rows = (("H5a", "contradicted", sentence), ("H5b", "supported", "less | <b>"), ("OLD", "supported", ""))
    with (folder / "earlier.csv").open("w", newline="") as file:
        csv.writer(file).writerows([("claim", "claim's verdict", "sentence"), *rows])
    (folder / "report").mkdir()
    for name in [*GONE, *STAYING]:
        (folder / "report" / name).touch()
    with redirect_stdout(io.StringIO()) as out, redirect_stderr(io.StringIO()) as err:
        main([str(folder)])
    return Odd(folder, out.getvalue(), err.getvalue())
