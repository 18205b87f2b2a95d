"""The folder tree is the architecture: imports point down only, and no file grows past its subject."""

import ast
from pathlib import Path

import pytest

PACKAGE = Path(__file__).parent.parent / "ship_trl"
# What each part may import of the package, besides itself.
BELOW = {"config", "paths"}
SIM = BELOW | {"sim"}
ALLOWED = {
    "paths": set(),
    "config": {"paths"},
    "architecture": BELOW,
    "checks": {"architecture", "config", "limits", "shapes"},
    "limits": {"architecture", "config"},
    "shapes": {"config"},
    "jit": set(),
    "outside": {"paths"},
    "progress": set(),
    "sim": BELOW | {"jit", "outside", "shapes"},
    "learn": BELOW | {"architecture", "jit"},
    "transfer": SIM | {"architecture", "learn", "result", "table"},
    "result": {"paths"},
    "table": BELOW,
    "curve": {"paths"},
    "view": SIM | {"curve", "demonstrations", "entries", "learn", "policies"},
    "stop": set(),
    "cli": BELOW | {"stop"},
    "pretrained": SIM,
    "demonstrations": SIM,
    "pretrain": SIM | {"cli", "curve", "learn", "policies", "pretrained", "result", "run", "transfer"},
    "gym_env": SIM | {"view"},
    "vector_env": SIM,
    "run": SIM
    | {"__version__", "architecture", "curve", "demonstrations", "learn", "pretrained", "progress"}
    | {"outside", "result", "stop", "transfer", "view"},
    "cases": SIM | {"cli", "transfer", "view"},
    "launchers": {"cli", "config", "stop"},
    "sweep": {"config", "outside"},
    "grid": BELOW | {"checks", "cli", "launchers", "run"},
    "study": SIM
    | {
        "architecture",
        "checks",
        "cli",
        "curve",
        "launchers",
        "outside",
        "progress",
        "result",
        "run",
        "shapes",
        "stop",
        "table",
        "transfer",
    },
    "report": {"cli", "config", "study"},
    "results": {"cli", "config", "curve", "result", "run", "study", "view"},
    "policies": SIM | {"learn", "pretrained", "transfer"},
    "entries": SIM
    | {"checks", "cli", "learn", "outside", "policies", "pretrained", "result", "results", "transfer"},
    "evaluate": SIM | {"cli", "demonstrations", "entries", "learn", "pretrained", "results", "run", "view"},
    "play": SIM | {"cli", "demonstrations", "run", "view", "watch"},
    "watch": SIM | {"cli", "entries", "run", "view"},
    "record": SIM | {"cli", "entries", "learn", "run", "transfer", "view", "watch"},
    "explain": SIM
    | {"architecture", "cli", "entries", "learn", "outside", "policies", "pretrained", "result", "run"}
    | {"study", "transfer"},
    "export": SIM | {"__version__", "cli", "entries", "learn", "policies", "pretrained", "run", "transfer"},
    "bench": SIM | {"architecture", "checks", "cli", "gym_env", "learn", "run", "transfer", "vector_env"},
    "__main__": BELOW | {"checks", "cli", "launchers", "run", "stop"},
    "__init__": SIM | {"learn", "policies", "pretrained"},
}
# What each room of the study may import of the others; rules and margins are what the analysis plan fixes.
# Commands beside the rooms import any.
ROOMS = {
    "rules": set(),
    "plan": {"rules"},
    "records": {"plan"},
    "margins": {"analysis"},
    "analysis": {"plan", "records", "margins"},
    "claims": {"plan", "records", "analysis"},
    "report": {"rules", "plan", "records", "analysis", "claims"},
    "launch": {"plan", "records"},
}
WITHOUT_TORCH = (
    "config",
    "architecture",
    "checks",
    "limits",
    "shapes",
    "paths",
    "run/checkpoint",
    "run/folder",
    "run/plan",
    "stop",
    "result",
    "cli",
    "outside",
    "progress",
    "__main__",
    "bench/__main__",
    "sim/cases",
    "transfer/similarity",
    "transfer/casebase",
    "transfer/measured",
    "study/records/layers",
    "explain/study",
    "launchers",
    "pretrained/__init__",
    "demonstrations",
    "pretrain",
    "entries",
    "evaluate",
    "play",
    "watch",
    "record",
    "explain/__main__",
    "export",
    "report",
    "results",
    "study/__main__",
    "study/keep",
    "curve",
    "study/records/record",
    "study/records/tables",
    "study/records/restore",
    "study/report/wandb_summary",
    "study/report/write",
)
FILES = sorted(PACKAGE.rglob("*.py"))


def part(path: Path) -> str:
    return path.relative_to(PACKAGE).parts[0].removesuffix(".py")


def imports(path: Path) -> list[str]:
    names = []
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            names += [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}: relative import"
            names += [f"{node.module}.{alias.name}" for alias in node.names]
    return names


@pytest.mark.parametrize("path", FILES, ids=lambda p: str(p.relative_to(PACKAGE)))
def test_imports_point_down(path: Path) -> None:
    mine = part(path)
    for name in imports(path):
        if name.startswith("ship_trl."):
            other = name.split(".")[1]
            assert other == mine or other in ALLOWED[mine], f"{mine} must not import {name}"


@pytest.mark.parametrize("path", sorted((PACKAGE / "study").rglob("*.py")), ids=lambda p: p.stem)
def test_rooms_of_the_study_lie_on_one_another(path: Path) -> None:
    room = path.relative_to(PACKAGE / "study").parts[0].removesuffix(".py")
    for name in imports(path) if room in ROOMS else ():
        if name.startswith("ship_trl.study."):
            other = name.split(".")[2]
            assert other == room or other in ROOMS[room], f"{room} must not import {name}"


@pytest.mark.parametrize("path", FILES, ids=lambda p: str(p.relative_to(PACKAGE)))
def test_files_have_one_subject(path: Path) -> None:
    assert len(path.read_text().splitlines()) <= 300
    assert path.stem not in {"utils", "common", "helpers", "misc"}


@pytest.mark.parametrize("name", WITHOUT_TORCH)
def test_checks_come_before_torch(name: str) -> None:
    tree = ast.parse((PACKAGE / f"{name}.py").read_text())
    top = [n for n in tree.body if isinstance(n, ast.Import | ast.ImportFrom)]
    for node in top:
        names = [a.name for a in node.names] if isinstance(node, ast.Import) else [str(node.module)]
        for module in names:
            assert not module.startswith(("torch", "tensordict"))


def test_learner_does_not_know_the_simulator() -> None:
    for path in (PACKAGE / "learn").glob("*.py"):
        assert not any("sim" in name.split(".") for name in imports(path))
