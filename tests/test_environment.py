"""environment.txt, the lock: what it pins for whom, and that pyproject.toml asks for the same."""

import re
import tomllib
from importlib import metadata
from types import SimpleNamespace

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name as canonical

from ptae_lite.book import doctor

TEXT = (doctor.ROOT / "environment.txt").read_text("utf-8")
LOCK = [Requirement(line) for line in TEXT.splitlines() if not line.startswith("#")]
PROJECT = tomllib.loads((doctor.ROOT / "pyproject.toml").read_text("utf-8"))["project"]
EXTRAS = PROJECT["optional-dependencies"]
DIRECT = [
    Requirement(line) for line in [*PROJECT["dependencies"], *EXTRAS["test"], *EXTRAS["site"]]
]
SYSTEMS = {
    "Linux": ("linux", "x86_64", "posix"),
    "Linux on ARM": ("linux", "aarch64", "posix"),
    "macOS": ("darwin", "arm64", "posix"),
    "macOS on Intel": ("darwin", "x86_64", "posix"),
    "Windows": ("win32", "AMD64", "nt"),
    "Windows on ARM": ("win32", "ARM64", "nt"),
}
MINORS = (11, 12, 13, 14)
PLACES = [(system, minor) for system in SYSTEMS for minor in MINORS]


def markers(system: str, minor: int) -> dict:
    """What markers ask, of CPython 3.`minor` on a system."""
    names = ("sys_platform", "platform_machine", "os_name")
    versions = {"python_version": f"3.{minor}", "python_full_version": f"3.{minor}.2"}
    return dict(zip(names, SYSTEMS[system], strict=True)) | versions


def chosen(requirements: list, system: str, minor: int) -> dict:
    """The pins of a place by package; each package is pinned once."""
    at = markers(system, minor)
    here = [one for one in requirements if one.marker is None or one.marker.evaluate(at)]
    found = {canonical(one.name): str(one.specifier) for one in here}
    assert len(found) == len(here)
    return found


def test_every_line_is_one_version_of_a_package_and_no_address():
    for one in LOCK:
        assert re.fullmatch(r"==[\d.]+", str(one.specifier)) and not one.url and not one.extras, one


@pytest.mark.parametrize(("system", "minor"), PLACES)
def test_the_lock_has_what_the_project_asks_for(system, minor):
    lock, direct = chosen(LOCK, system, minor), chosen(DIRECT, system, minor)
    assert direct and direct.items() <= lock.items()


def test_the_lock_has_all_that_its_packages_bring():
    """For this Python and system. CUDA's libraries, which one build of PyTorch brings, are none
    of the book's."""
    here = doctor.pins(doctor.ROOT / "environment.txt")
    for package in set(here) - {"torch"}:
        for line in metadata.requires(package) or ():
            one = Requirement(line)
            if one.marker is None or one.marker.evaluate({"extra": ""}):
                version = here.get(canonical(one.name))
                assert version and one.specifier.contains(version), (package, line)


@pytest.mark.parametrize(("system", "minor"), PLACES)
def test_there_is_one_pybullet_where_a_wheel_exists_and_never_two(system, minor):
    found = {name for name in chosen(LOCK, system, minor) if "pybullet" in name}
    if minor > 13 or system not in ("Linux", "macOS", "Windows"):
        assert found == set()
    elif (system, minor) == ("Linux", 11):
        assert found == {"pybullet"}
    else:
        assert found == {"pybullet-arm64"}


@pytest.mark.parametrize(("system", "minor"), PLACES)
def test_the_doctor_reads_markers_as_pip_does(system, minor, monkeypatch):
    platform, machine, os_name = SYSTEMS[system]
    cpython = SimpleNamespace(name="cpython")
    there = SimpleNamespace(version_info=(3, minor, 2), platform=platform, implementation=cpython)
    path = doctor.ROOT / "environment.txt"
    monkeypatch.setattr(doctor, "sys", there)
    monkeypatch.setattr(doctor, "os", SimpleNamespace(name=os_name))
    monkeypatch.setattr(doctor, "platform", SimpleNamespace(machine=lambda: machine))
    assert {name: f"=={version}" for name, version in doctor.pins(path).items()} == chosen(
        LOCK, system, minor
    )
