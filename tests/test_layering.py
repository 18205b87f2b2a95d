"""The folder tree is the architecture: imports point down only, and no file grows past its subject."""

import ast
from graphlib import TopologicalSorter
from pathlib import Path

import pytest

PACKAGE = Path(__file__).parent.parent / "ship_trl"
# The rooms from the bottom up: each may import what stands before it.
ROOMS = (
    "config", "files", "sim", "formats", "foreign", "learn", "transfer", "fast", "policies", "view", "gym",
    "run", "grid", "study", "explain", "cli", "__main__",
)  # fmt: skip
# What a user's `import ship_trl` offers, in functions: any room.
TOP = "__init__"
# Checks come before torch: no file of these imports it at its top.
WITHOUT_TORCH = (
    "config", "files", "cli", "__main__", "sim/cases", "formats", "foreign/suites", "foreign/cases",
    "transfer/similarity", "transfer/casebase",
    "policies/pretrained", "policies/demonstrations", "policies/registry",
    "run/plan", "run/process", "run/console", "grid/launchers", "run/results",
    "grid/callback", "grid/compose", "run/entries", "run/pretrain",
    "explain/study", "study", "learn/settings", "learn/hooks", "transfer/methods",
)  # fmt: skip
FILES = sorted(PACKAGE.rglob("*.py"))
OUTSIDE = [path for name in ("benchmarks", "studies") for path in (PACKAGE.parent / name).rglob("*.py")]


def room(path: Path) -> str:
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
    own = room(path)
    if own == TOP:
        return
    for name in imports(path):
        if name.startswith("ship_trl.") and name != "ship_trl.__version__":
            other = name.split(".")[1]
            assert ROOMS.index(other) <= ROOMS.index(own), f"{own} must not import {name}"


def test_no_files_import_each_other_in_a_circle() -> None:
    """Imports in functions count too."""
    modules = {
        ".".join(path.relative_to(PACKAGE.parent).with_suffix("").parts).removesuffix(".__init__"): path
        for path in FILES
        if path.parent != PACKAGE or path.stem != TOP
    }
    arrows: dict[str, set[str]] = {}
    for module, path in modules.items():
        names = {name if name in modules else name.rpartition(".")[0] for name in imports(path)}
        arrows[module] = names & modules.keys() - {module}
    list(TopologicalSorter(arrows).static_order())


def test_the_package_does_not_know_what_is_made_with_it() -> None:
    for path in FILES:
        tops = {name.split(".")[0] for name in imports(path)}
        assert not tops & {"benchmarks", "studies", "tests"}, path


@pytest.mark.parametrize("path", [*FILES, *OUTSIDE], ids=lambda p: f"{p.parent.name}/{p.name}")
def test_files_have_one_subject(path: Path) -> None:
    assert len(path.read_text().splitlines()) <= 500
    assert path.stem not in {"utils", "common", "helpers", "misc"}


def test_checks_come_before_torch() -> None:
    mains = [path.with_suffix("") for path in OUTSIDE if path.stem == "__main__"]
    for place in (*(PACKAGE / name for name in WITHOUT_TORCH), *mains):
        files = sorted(place.rglob("*.py")) if place.is_dir() else [place.with_suffix(".py")]
        for path in files:
            for node in ast.parse(path.read_text()).body:
                names = [a.name for a in node.names] if isinstance(node, ast.Import) else []
                names += [str(node.module)] if isinstance(node, ast.ImportFrom) else []
                assert not any(one.startswith(("torch", "tensordict")) for one in names), f"{path}: {names}"


def test_learner_does_not_know_the_simulator() -> None:
    for path in (PACKAGE / "learn").rglob("*.py"):
        assert not any("sim" in name.split(".") for name in imports(path))
