"""Each example runs as its first lines say."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from ship_trl.evaluate import main
from tests.test_cli import ROOT

EXAMPLES = sorted((ROOT / "examples").glob("*.py"))
DRAWS = {"huber_threshold": "huber_threshold.png"}
ARGUMENTS = {
    "huber_threshold": [DRAWS["huber_threshold"]],
    "stock_torchrl": ["--steps", "400"],
    "gymnasium_sb3": ["--steps", "300"],
    "study_in_pandas": [str(ROOT / "outputs/quick_study/report/runs.csv")],
}
MOST_LINES = 80


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)
def test_an_example_runs(path: Path, tmp_path: Path) -> None:
    line = [sys.executable, str(path), *ARGUMENTS.get(path.stem, [])]
    environment = os.environ | {"PYTHONPATH": str(ROOT), "OMP_NUM_THREADS": "1"}
    subprocess.run(line, cwd=tmp_path, env=environment, check=True, timeout=120)
    if path.stem in DRAWS:
        picture = np.asarray(Image.open(tmp_path / DRAWS[path.stem]))
        assert picture.std() > 5


def test_torchrl_alone_takes_few_lines() -> None:
    assert len((ROOT / "examples" / "stock_torchrl.py").read_text().splitlines()) <= MOST_LINES


def test_a_collision_is_forgotten_with_a_small_threshold() -> None:
    sys.path.insert(0, str(ROOT / "examples"))
    from huber_threshold import COLLISION, settled

    for share in (0.1, 0.25):
        assert settled(1.0, share) == pytest.approx(-share / (1 - share), abs=0.05)
        assert settled(10.0, share) == pytest.approx(-10 * share / (1 - share), abs=0.05)
        assert settled(20.0, share) == pytest.approx(COLLISION * share, abs=0.05)


def test_a_policy_of_ones_own_gives_way(capsys: pytest.CaptureFixture[str]) -> None:
    main([f"{ROOT / 'examples/own_policy.py'}:policy", "keep_course", "target=4", "--markdown"])
    own, kept = capsys.readouterr().out.splitlines()[2:4]
    assert "| goal |" in own and "| collision |" in kept
