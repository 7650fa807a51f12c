"""The doctor: every thing it looks at, well and ill, with the command that mends it."""

import json
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from ptae_lite import artefacts
from ptae_lite.book import doctor, machine, memory
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
    before = "import sys; sys.path.insert(0, 'src'); before = {*sys.modules}"
    after = "import ptae_lite.book.doctor; print(*({*sys.modules} - before))"
    code = [sys.executable, "-I", "-S", "-c", f"{before}; {after}"]  # -S: there are no packages
    done = subprocess.run(code, cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    names = {name.split(".")[0] for name in done.stdout.split()}
    assert names <= {*sys.stdlib_module_names, "ptae_lite"}


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


def test_scripts_of_others_that_are_missing_are_a_warning_with_a_command():
    found = doctor.check_scripts(["onnxruntime-web"])
    assert found.state == WARNING and "onnxruntime-web is not installed" in found.says
    assert found.mend.endswith("scripts.py") and (ROOT / found.mend.split()[-1]).is_file()
    assert doctor.check_scripts([]).state == GOOD


@pytest.mark.parametrize("system", doctor.NO_TORCH)
def test_where_pytorch_has_no_wheel_that_is_the_problem(root, system, monkeypatch):
    monkeypatch.setattr(doctor.sys, "platform", system[0])
    monkeypatch.setattr(doctor.platform, "machine", lambda: system[1])
    found = doctor.check_packages(root, have())
    assert found.state == PROBLEM and doctor.NO_TORCH[system] in found.says
    assert doctor.check_packages(root, have(torch="2.13.0")).says != found.says  # built by hand


def test_the_disk_has_room_for_what_comes_next(tmp_path, monkeypatch):
    """The install if there is none, and runs after it."""
    assert machine.check_disk(int(3e9), tmp_path).state == GOOD  # as on a hub: torch is there
    monkeypatch.setattr(machine, "installed", lambda package: None)
    for made, needed in ((False, 6), (True, 2)):
        if made:
            (tmp_path / ".venv").mkdir()
        full = machine.check_disk(int(1e9), tmp_path)
        assert full.state == PROBLEM and f"1.0 GB are free, {needed} are needed" in full.says
        assert full.mend == f"{doctor.python()} -m pip cache purge"
        assert machine.check_disk(int(3e9), tmp_path).state == (GOOD if made else PROBLEM)


def test_an_old_python_is_told_so_and_not_met_by_a_traceback(monkeypatch):
    """Python 3.10 has no `hashlib.file_digest`."""
    monkeypatch.delattr(doctor.hashlib, "file_digest", raising=False)
    monkeypatch.setattr(doctor, "MINIMUM", (99, 0))
    findings = doctor.examine()
    assert findings[0].state == PROBLEM and "is older than 99.0" in findings[0].says
    assert findings[-1].what == "data" and findings[-1].state == GOOD


def test_disk_memory_cores_and_browser():
    assert machine.check_disk(int(9e9)).state == GOOD
    assert machine.check_cores(2).state == GOOD
    assert machine.check_cores(1).state == WARNING
    found = machine.check_chromium(lambda name: None)
    assert found.state == WARNING and "the tests skip" in found.says
    assert machine.check_chromium(lambda name: f"/bin/{name}").says == "/bin/chromium"


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


# ---------------------------------------------------------------- line ends


@pytest.fixture
def rewritten(root):
    """A project with a table and a damaged file, both rewritten with the line ends of Windows."""
    for name in ("table.csv", "broken.csv"):
        (root / "data" / name).write_bytes(b"a,b\n1,2\n")
        artefacts.register(name, command="x", seed=0, minutes=0, data=root / "data")
    (root / "data/table.csv").write_bytes(b"a,b\r\n1,2\r\n")
    (root / "data/broken.csv").write_bytes(b"a,b\r\n1,3\r\n")
    return root


def test_line_ends_are_told_apart_from_damage_and_mended(rewritten):
    broken, ends = doctor.check_data(rewritten)
    assert broken.says == "data/broken.csv is damaged"
    assert "data/table.csv" in ends.says and "CRLF" in ends.says and ends.state == PROBLEM
    assert ends.mend.endswith("run.py doctor --line-endings")
    with pytest.raises(artefacts.ArtefactError, match="CRLF.*doctor --line-endings"):
        artefacts.stored("table.csv", rewritten / "data")

    assert doctor.mend_line_endings(rewritten) == ["table.csv"]
    assert doctor.check_data(rewritten) == [broken]
    assert (rewritten / "data/broken.csv").read_bytes() == b"a,b\r\n1,3\r\n"  # as it was
    assert artefacts.stored("table.csv", rewritten / "data").read_bytes() == b"a,b\n1,2\n"
    assert doctor.mend_line_endings(rewritten) == []


@pytest.mark.skipif(not (ROOT / ".git").exists(), reason="this is no checkout of git")
@pytest.mark.parametrize("setting", ["core.autocrlf=true", "core.eol=crlf", "core.autocrlf=input"])
def test_git_gives_the_same_bytes_on_every_system(setting, tmp_path):
    """Its files as it would write them with a setting, as of Git for Windows."""
    command = ["git", "-c", setting, "checkout-index", "--all", f"--prefix={tmp_path}/"]
    subprocess.run(command, cwd=ROOT, check=True)
    assert doctor.check_data(tmp_path)[0].state == GOOD
    texts = [p for p in tmp_path.rglob("*") if p.suffix in (".py", ".md", ".csv", ".txt", ".ipynb")]
    assert len(texts) > 100
    assert [path.name for path in texts if b"\r\n" in path.read_bytes()] == []


# ---------------------------------------------------------------- whose library


def test_the_library_of_another_folder_is_a_problem(root, tmp_path_factory):
    own, other = (
        folder / "src/ptae_lite/__init__.py" for folder in (root, tmp_path_factory.mktemp("o"))
    )
    for path in (own, other):
        path.parent.mkdir(parents=True)
        path.touch()
    assert doctor.check_library(root, str(own)).state == GOOD
    for found in (str(other), ""):
        finding = doctor.check_library(root, found)
        assert finding.state == PROBLEM and finding.mend.endswith("pip install --no-deps -e .")
    assert str(other.parents[1]) in doctor.check_library(root, str(other)).says

    for folder, state in ((root, GOOD), ("/elsewhere", PROBLEM)):
        (root / ".venv/installed.json").write_text(json.dumps({"folder": str(folder)}))
        assert doctor.check_library(root, str(own)).state == state
    assert "/elsewhere" in doctor.check_library(root, str(own)).says


def test_this_library_is_the_one_that_is_found():
    assert Path(doctor._find_library()).samefile(artefacts.ROOT / "src/ptae_lite/__init__.py")


# ---------------------------------------------------------------- memory and settings


def proc(folder, groups, **limits):
    """Made-up `/proc` and `/sys`: the lines of this process's groups, and limits by their paths."""
    path = folder / "proc/self/cgroup"
    path.parent.mkdir(parents=True)
    path.write_text(groups)
    for name, text in limits.items():
        path = folder / "sys/fs/cgroup" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text + "\n")
    return folder


@pytest.mark.parametrize(
    ("groups", "limits", "expected"),
    [
        ("0::/user/app\n", {"user/app/memory.max": "900", "memory.max": "max"}, 900),
        ("0::/user/app\n", {"user/app/memory.max": "900", "user/memory.max": "800"}, 800),
        ("0::/seen/from/outside\n", {"memory.max": "700"}, 700),  # in a container
        ("5:cpu,memory:/a\n0::/\n", {"memory/a/memory.limit_in_bytes": "600"}, 600),
        ("5:memory:/docker/7\n", {"memory/memory.limit_in_bytes": "500"}, 500),
        ("5:cpu:/a\n", {"memory/memory.limit_in_bytes": "500"}, None),
        ("0::/\n", {"memory.max": "max"}, None),
    ],
)
def test_the_limit_of_a_container_is_read_in_both_versions(groups, limits, expected, tmp_path):
    found = memory.limits(proc(tmp_path, groups, **limits))
    found.pop("the machine", None)
    assert [*found.values()] == ([] if expected is None else [expected])


def test_where_the_system_says_nothing(tmp_path):
    assert memory.limits(tmp_path).keys() <= {"the machine"}


def test_the_least_limit_counts():
    def state(**limits):
        return machine.check_memory(limits).state

    assert state(machine=int(8e9)) == GOOD and state() == GOOD
    assert state(machine=int(8e9), group=int(1.6e9)) == WARNING
    assert state(machine=int(8e9), group=int(0.5e9)) == PROBLEM
    assert "by group" in machine.check_memory({"machine": 8 * 10**9, "group": 10**9}).says
    found = machine.check_memory({"machine": 8 * 10**9}, addresses=10**9)
    assert found.state == PROBLEM and "ulimit -v" in found.mend


def test_settings_of_another_project_are_named():
    assert machine.check_variables({"PATH": "x", "VIRTUAL_ENV": str(ROOT / ".venv")}) == []
    found = machine.check_variables({"PYTHONPATH": "/opt/ros", "VIRTUAL_ENV": "/other/.venv"})
    assert [one.state for one in found] == [WARNING, WARNING]
    assert "PYTHONPATH=/opt/ros" in found[0].says and found[0].mend.endswith("PYTHONPATH")


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
