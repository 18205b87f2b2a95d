"""requirements.lock has one version of each package, within the ranges of pyproject.toml, for any index."""

import re
import tomllib
from itertools import chain

import pytest
from packaging.requirements import Requirement
from packaging.specifiers import SpecifierSet
from packaging.utils import canonicalize_name

from tests.command import ROOT

PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
EXTRAS = PROJECT["optional-dependencies"]
PYTHONS = [one.rpartition(" ")[2] for one in PROJECT["classifiers"] if "Python :: 3." in one]
# Supported environments: every Python, on the system of images and workflows.
PLACES = [
    {"python_version": version, "python_full_version": f"{version}.9", "sys_platform": "linux"}
    | {"platform_machine": "x86_64", "platform_system": "Linux", "os_name": "posix", "extra": ""}
    | {"implementation_name": "cpython", "platform_python_implementation": "CPython"}
    for version in PYTHONS
]


def locked(place: dict[str, str]) -> dict[str, Requirement]:
    """Return the pins that apply in an environment, by name."""
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
    for wanted in map(Requirement, chain(PROJECT["dependencies"], *EXTRAS.values())):
        found = version(pins[canonicalize_name(wanted.name)])
        assert wanted.specifier.contains(found), f"{wanted}: the lock has {found}; run `make lock`"


def test_the_project_names_every_python_that_it_allows() -> None:
    allowed = SpecifierSet(PROJECT["requires-python"])
    assert [f"3.{minor}" for minor in range(40) if f"3.{minor}.9" in allowed] == PYTHONS


def test_it_names_versions_but_no_index() -> None:
    """The user chooses the index: a mirror, or one with CPU wheels of torch."""
    text = (ROOT / "requirements.lock").read_text()
    assert not re.search(r"://|^\s*-|file:|\+cpu| @ ", text, re.MULTILINE)
