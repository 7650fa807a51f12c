"""The doctor: every thing it looks at, well and ill, with the command that mends it."""

import ast
import json
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from ptae_lite import artefacts
from ptae_lite.book import doctor
from ptae_lite.book.doctor import GOOD, PROBLEM, WARNING

ROOT = artefacts.ROOT
PINS = 'numpy==2.0\ntorch==2.13.0\npybullet==3.2.7; python_version < "{}"\n# x==1\n'


@pytest.fixture
def root(tmp_path):
    """A project with an environment and one stored file."""
    (tmp_path / "environment.txt").write_text(PINS.format("9.9"))
    (tmp_path / ".venv").mkdir()
    (tmp_path / "data").mkdir()
    (tmp_path / "data/one.bin").write_bytes(b"whole")
    artefacts.register("one.bin", command="x", seed=0, minutes=0, data=tmp_path / "data")
    return tmp_path


def have(**versions):
    return lambda package: versions.get(package)


def test_it_needs_nothing_but_the_standard_library():
    tree = ast.parse(Path(doctor.__file__).read_text("utf-8"))
    names = {n.module for n in ast.walk(tree) if isinstance(n, ast.ImportFrom)}
    names |= {a.name for n in ast.walk(tree) if isinstance(n, ast.Import) for a in n.names}
    assert {name.split(".")[0] for name in names} <= sys.stdlib_module_names


def test_an_old_python_is_a_problem():
    found = doctor.check_python((3, 10, 4))
    assert found.state == PROBLEM and "3.10.4 is older than 3.11" in found.says
    assert "delete .venv/, then:" in found.mend
    assert doctor.check_python((3, 14, 0)).state == GOOD


def test_pins_are_read_with_their_markers(root):
    assert doctor.pins(root / "environment.txt") == {
        "numpy": "2.0", "torch": "2.13.0", "pybullet": "3.2.7"
    }  # fmt: skip
    (root / "environment.txt").write_text(PINS.format("3.11"))
    assert "pybullet" not in doctor.pins(root / "environment.txt")
    marker = 'sys_platform == "amiga" and {0} or {0} and os_name != "amiga"'
    assert doctor.holds(marker.format('python_full_version >= "3.11"')) and doctor.holds(None)
    assert not doctor.holds(marker.format('python_version < "3.11"'))


def test_packages_that_are_missing_or_of_another_version_are_named(root):
    good = {"numpy": "2.0", "torch": "2.13.0+cpu", "ptae_lite": "0.1"}
    assert doctor.check_packages(root, have(**good)).state == GOOD
    found = doctor.check_packages(root, have(torch="2.12.0"))
    assert "numpy is missing (not 2.0), torch 2.12.0 (not 2.13.0)" in found.says
    assert found.mend.endswith("-m pip install -r environment.txt") and found.state == PROBLEM
    found = doctor.check_packages(root, have(**good | {"ptae_lite": None}))
    assert found.mend.endswith("-m pip install --no-deps -e .")


def test_without_an_environment_there_is_one_thing_to_do(root):
    (root / ".venv").rmdir()
    found = doctor.check_packages(root, have())
    assert found.says == "there is no .venv/ yet" and found.mend.endswith("run.py book")


def manager(folder, version):
    path = folder / doctor.MANAGER
    path.parent.mkdir(parents=True)
    path.write_text(json.dumps({"version": version}))
    return folder


def test_the_two_halves_of_the_widgets_must_fit(tmp_path):
    new, old = manager(tmp_path / "new", "5.0.16"), manager(tmp_path / "old", "3.1.11")
    kernel = have(ipywidgets="8.1.9", jupyterlab_widgets="3.0.17")
    assert doctor.check_widgets([new, old], kernel).state == GOOD
    found = doctor.check_widgets([old, new], kernel)  # the first copy is the one that is used
    assert found.state == PROBLEM and "needs version 5 in JupyterLab; " in found.says
    assert "old" in found.mend and found.mend.split()[0] in ("rm", "rmdir")
    found = doctor.check_widgets([tmp_path], kernel)
    assert "has no part for ipywidgets" in found.says
    assert "ipywidgets==8.1.9 jupyterlab_widgets==3.0.17" in found.mend
    assert doctor.check_widgets([new], have()).state == WARNING


def test_the_widgets_of_this_environment_fit():
    assert doctor.check_widgets().state == GOOD


@pytest.mark.parametrize("version", ["9.9", "3.11"])  # there is a wheel; there is none
def test_pybullet_is_never_a_problem(root, version):
    (root / "environment.txt").write_text(PINS.format(version))
    found = doctor.check_pybullet(root / "environment.txt", lambda: False)
    assert found.state == WARNING and "all chapters run from what is stored" in found.says
    assert found.mend.endswith("pybullet==3.2.7") is (version == "9.9")
    assert ("no wheel" in found.says) is (version == "3.11")
    found = doctor.check_pybullet(root / "environment.txt", lambda: True)  # wherever it is from
    assert found.state == GOOD and not found.mend


@pytest.mark.parametrize("system", doctor.NO_TORCH)
def test_where_pytorch_has_no_wheel_that_is_the_problem(root, system, monkeypatch):
    monkeypatch.setattr(doctor.sys, "platform", system[0])
    monkeypatch.setattr(doctor.platform, "machine", lambda: system[1])
    found = doctor.check_packages(root, have())
    assert found.state == PROBLEM and doctor.NO_TORCH[system] in found.says
    assert doctor.check_packages(root, have(torch="2.13.0")).says != found.says  # built by hand


def test_the_disk_has_room_for_what_comes_next(tmp_path, monkeypatch):
    """The install if there is none, and runs after it."""
    assert doctor.check_disk(int(3e9), tmp_path).state == GOOD  # as on a hub: torch is there
    monkeypatch.setattr(doctor, "installed", lambda package: None)
    for made, needed in ((False, 6), (True, 2)):
        if made:
            (tmp_path / ".venv").mkdir()
        full = doctor.check_disk(int(1e9), tmp_path)
        assert full.state == PROBLEM and f"1.0 GB are free, {needed} are needed" in full.says
        assert full.mend == f"{doctor.python()} -m pip cache purge"
        assert doctor.check_disk(int(3e9), tmp_path).state == (GOOD if made else PROBLEM)


def test_an_old_python_is_told_so_and_not_met_by_a_traceback(monkeypatch):
    """Python 3.10 has no `hashlib.file_digest`."""
    monkeypatch.delattr(doctor.hashlib, "file_digest", raising=False)
    monkeypatch.setattr(doctor, "MINIMUM", (99, 0))
    findings = doctor.examine()
    assert findings[0].state == PROBLEM and "is older than 99.0" in findings[0].says
    assert findings[-1].what == "data" and findings[-1].state == GOOD


def test_disk_memory_cores_and_browser():
    assert doctor.check_disk(int(9e9)).state == GOOD
    assert doctor.check_memory(int(2e9)).state == WARNING
    assert doctor.check_memory(int(8e9)).state == doctor.check_cores(2).state == GOOD
    assert doctor.check_cores(1).state == WARNING
    found = doctor.check_chromium(lambda name: None)
    assert found.state == WARNING and "the tests skip" in found.says
    assert doctor.check_chromium(lambda name: f"/bin/{name}").says == "/bin/chromium"


def test_a_missing_and_a_damaged_file_are_named_with_what_restores_them(root):
    assert doctor.check_data(root)[0].state == GOOD
    (root / "data/two.bin").write_bytes(b"2")
    artefacts.register("two.bin", command="x", seed=0, minutes=0, data=root / "data")
    (root / "data/one.bin").write_bytes(b"w hole")
    (root / "data/two.bin").unlink()
    (root / ".git").mkdir()
    one, two = doctor.check_data(root)
    assert (one.says, two.says) == ("data/one.bin is damaged", "data/two.bin is missing")
    assert one.mend == 'git checkout "data/one.bin"'
    (root / ".git").rmdir()
    assert "download the project again" in doctor.check_data(root)[0].mend


@pytest.mark.parametrize("text", ["{", "[]", '{"one.bin": 3}', '{"one.bin": {}}', "\xff"])
def test_a_damaged_manifest_is_one_problem(root, text):
    (root / "data/MANIFEST.json").write_text(text, "latin-1")
    (found,) = doctor.check_data(root)
    assert found.says == "data/MANIFEST.json is missing or damaged" and found.state == PROBLEM


def test_warnings_alone_are_no_failure(monkeypatch, capsys):
    good = doctor.Finding("a", GOOD, "fine")
    warning = doctor.Finding("b", WARNING, "is not there", "install it")
    problem = doctor.Finding("c", PROBLEM, "is broken", "mend it so")
    for findings, code in (([good, warning], 0), ([good, warning, problem], 1)):
        monkeypatch.setattr(doctor, "examine", lambda findings=findings: findings)
        assert doctor.main([]) == code
        out = capsys.readouterr().out
        assert "mend it:  install it" in out and "Warnings: 1; the book runs with them." in out
        assert ("1 to mend, in this order." in out) == bool(code)
        assert doctor.main(["--json"]) == code
        assert json.loads(capsys.readouterr().out)[1]["mend"] == "install it"


def test_it_knows_this_project():
    found = {one.what: one.state for one in (*doctor.check_data(), doctor.check_python())}
    assert found == {"data": GOOD, "Python": GOOD}


def newer_pythons() -> list[str]:
    """Interpreters after 3.11 on this machine: on the path, or pyenv's."""
    found = [shutil.which(f"python3.{minor}") for minor in range(12, 20)]
    found += Path.home().glob(".pyenv/versions/3.1[2-9]*/bin/python")
    there = [str(path) for path in found if path]  # a name on the path may still lead nowhere
    return [p for p in there if subprocess.run([p, "-V"], capture_output=True).returncode == 0]


def test_a_newer_python_runs_what_comes_before_any_package():
    pythons = newer_pythons()
    if not pythons:
        pytest.skip("there is no Python after 3.11 here")
    for python in pythons:
        for command in (["run.py", "--help"], ["src/ptae_lite/book/doctor.py"]):
            done = subprocess.run([python, *command], cwd=ROOT, capture_output=True, text=True)
            assert done.returncode in (0, 1) and not done.stderr, done.stderr
        assert done.stdout.startswith("good     Python    3.1")
