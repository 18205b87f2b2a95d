"""The small runs that faults are tried on: two cases of ten steps, a transfer between them, a small study."""

from dataclasses import fields
from functools import cache
from pathlib import Path
from tempfile import mkdtemp

from ship_trl.config.types import Config
from tests.faults.command import run
from tests.faults.trial import state

CASES = {
    "near": "start: [0, 0]\nheading: 90\ngoal: [0, 180]\nideal_path: straight\ntarget_ships: []\n",
    "met": (
        "start: [0, 0]\nheading: 90\ngoal: [0, 185]\nideal_path: starboard\n"
        "target_ships: [{x: 60, y: 120, heading: 180, speed: 5}]\n"
    ),
}
# A world in which an episode ends after ten steps.
SHORT = (
    *("profile=smoke", "world.max_steps=10", "learn.warmup_steps=20", "learn.jumpstart_draws=2"),
    *("learn.episodes=3", "learn.evaluate_every=2"),
    # As many checkpoints as there can be, where runs keep any.
    *(["checkpoint.seconds=0"] if "checkpoint" in {field.name for field in fields(Config)} else []),
)
ALONE = (*SHORT, "target=near", "method=scratch")
TRANSFER = (*SHORT, "source=near", "target=met", "method=finetune", "layers=3")
STUDY = (
    *("profile=smoke", "pairs=[high]", "arms=[scratch,FTW]", "reuse=false", "controls=false"),
    *("processes=1", "overrides=[learn.episodes=2,learn.jumpstart_draws=0]"),
)


def a_folder(place: Path, number: int) -> Path:
    """Make a folder to run in, with the two cases."""
    folder = place / str(number)
    cases = folder / "conf/case"
    cases.mkdir(parents=True)
    for name, text in CASES.items():
        (cases / f"{name}.yaml").write_text(text)
    return folder


@cache
def undisturbed(arguments: tuple[str, ...], module: str = "ship_trl") -> tuple[Path, float]:
    """Run a command once without a fault; returns its folder, and how many seconds it took."""
    folder = a_folder(Path(mkdtemp(prefix="faults-")), 0)
    done = run(*arguments, folder=folder, module=module)
    assert done.code == 0, done
    return folder, done.seconds


def wanted(arguments: tuple[str, ...], module: str = "ship_trl") -> dict[str, bytes]:
    """Give what a command leaves without a fault."""
    return state(undisturbed(arguments, module)[0])
