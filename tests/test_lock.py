"""requirements.lock: one version of each package that is installed, fit for pyproject.toml and any index."""

import re
import tomllib
from importlib.metadata import Distribution, distributions

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

from tests.command import ROOT

PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
EXTRAS = PROJECT["optional-dependencies"]
# What people may have: both Pythons, on the system that images and workflows have.
PLACES = [
    {"python_version": version, "python_full_version": f"{version}.9", "sys_platform": "linux"}
    | {"platform_machine": "x86_64", "platform_system": "Linux", "os_name": "posix", "extra": ""}
    | {"implementation_name": "cpython", "platform_python_implementation": "CPython"}
    for version in ("3.11", "3.12")
]


def asked() -> list[Requirement]:
    """Everything that pyproject.toml names, of the extras too."""
    return [Requirement(line) for lines in (PROJECT["dependencies"], *EXTRAS.values()) for line in lines]


def locked(place: dict[str, str]) -> dict[str, Requirement]:
    """The pins that hold in an environment, by name."""
    lines = (ROOT / "requirements.lock").read_text().splitlines()
    pins = [Requirement(line) for line in lines if line and not line.lstrip().startswith("#")]
    held = [pin for pin in pins if pin.marker is None or pin.marker.evaluate(place)]
    assert len({canonicalize_name(pin.name) for pin in held}) == len(held), "two versions of one package"
    return {canonicalize_name(pin.name): pin for pin in held}


def version(pin: Requirement) -> str:
    (only,) = pin.specifier
    assert only.operator == "==" and not only.version.endswith("*"), pin
    return only.version


@pytest.mark.parametrize("place", PLACES, ids=lambda place: place["python_version"])
def test_every_range_of_the_project_holds_its_locked_version(place: dict[str, str]) -> None:
    pins = locked(place)
    for wanted in asked():
        found = version(pins[canonicalize_name(wanted.name)])
        assert wanted.specifier.contains(found), f"{wanted}: locked is {found}; `make lock` makes it anew"


def installed() -> dict[str, Distribution]:
    return {canonicalize_name(found.name): found for found in distributions()}


@pytest.mark.parametrize("place", PLACES, ids=lambda place: place["python_version"])
def test_what_the_dependencies_need_is_locked_too(place: dict[str, str]) -> None:
    """Of packages that are here in their locked version, for their metadata names what they need."""
    pins, here = locked(place), installed()
    left = [(canonicalize_name(wanted.name), frozenset(wanted.extras)) for wanted in asked()]
    seen = set(left)
    while left:
        name, extras = left.pop()
        assert name in pins, f"{name} is not locked; `make lock` makes it anew"
        found = here.get(name)
        # torch's CPU build is 2.13.0+cpu.
        if found is None or found.version.partition("+")[0] != version(pins[name]):
            continue
        for need in map(Requirement, found.requires or []):
            marker = need.marker
            if marker is None or any(marker.evaluate(place | {"extra": one}) for one in ("", *extras)):
                one = (canonicalize_name(need.name), frozenset(need.extras))
                left += [one] if one not in seen else []
                seen.add(one)
    assert len(seen) > len(asked())


def test_it_names_versions_and_no_place() -> None:
    """Whoever installs chooses the index: a mirror, or one with CPU wheels of torch."""
    text = (ROOT / "requirements.lock").read_text()
    assert not re.search(r"://|^\s*-|file:|\+cpu| @ ", text, re.MULTILINE)


def test_what_is_installed_by_it() -> None:
    """The Makefile, and so the workflows that call it, and both images."""
    assert "--constraint $(LOCK)" in (ROOT / "Makefile").read_text()
    for path in (ROOT / "docker").iterdir():
        lines = [line for line in path.read_text().splitlines() if "pip install" in line]
        assert lines and all("--constraint requirements.lock" in line for line in lines)
