"""Odd places to be in: other alphabets, spaces, another locale, another Python."""

import json
import shutil
import subprocess
import sys
import warnings
from types import SimpleNamespace

import pytest
from watch import ROOT, environment, run, unchanged

from ptae_lite.book import doctor

NO_UTF8 = {"LC_ALL": "C", "LANG": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"}


def python(*arguments, cwd=None, **more):
    return subprocess.run(
        [sys.executable, *map(str, arguments)], env=environment(**more), cwd=cwd,
        capture_output=True, text=True, encoding="utf-8", errors="replace",
    )  # fmt: skip


@pytest.fixture(scope="module")
def project(tmp_path_factory):
    """The library and its data in a folder with spaces, umlauts and another alphabet."""
    folder = tmp_path_factory.mktemp("x") / "Ein Büchlein für Алиса"
    for part in ("src", "data"):
        ignore = shutil.ignore_patterns("__pycache__")
        shutil.copytree(ROOT / part, folder / part, ignore=ignore)
    for name in ("environment.txt", "pyproject.toml", "run.py"):
        shutil.copy(ROOT / name, folder / name)
    return folder


@pytest.mark.slow
def test_a_project_in_a_folder_with_spaces_and_umlauts(project):
    run = python("-m", "ptae_lite", "evaluate", "data/weights/ptae.safetensors", "--split",
                 "held_out", "--json", cwd=project, PYTHONPATH=str(project / "src"))  # fmt: skip
    assert run.returncode == 0, run.stderr
    assert json.loads(run.stdout)["describe_accuracy"] > 90
    run = python("src/ptae_lite/book/doctor.py", "--json", cwd=project)
    found = {one["what"]: one for one in json.loads(run.stdout)}
    assert found["data"]["state"] == "good" and found["Python"]["state"] == "good"


@pytest.mark.slow
def test_a_recording_into_a_folder_with_spaces_and_umlauts(simulator, tmp_path):
    folder = tmp_path / "Aufnahme für später"
    code, said = run("record", folder)
    assert code == 0, said
    assert len(list(folder.glob("sequences/*.npz"))) == 6


@pytest.mark.slow
def test_a_locale_without_utf8(project):
    """Every text of ours is read, and a name that the locale cannot write ends nothing."""
    code = (
        "import sys, locale\n"
        "assert 'utf' not in locale.getpreferredencoding().lower()\n"
        "from ptae_lite import artefacts, cli\n"
        "from ptae_lite.data import authors, samples\n"
        "from ptae_lite.experiments import conflict_examples\n"
        "from ptae_lite.book import contents\n"
        "from pathlib import Path\n"
        "conflict_examples.load()\n"
        "contents.Contents(Path(sys.argv[1]))\n"
        "sys.exit(cli.guarded('read', lambda: print('M\\u00fcller \\u2192 \\u0410')))\n"
    )
    with unchanged(project / "data"):
        run = python(
            "-c", code, ROOT / "book", cwd=project, PYTHONPATH=str(project / "src"), **NO_UTF8
        )
    assert run.returncode == 0, run.stderr
    assert run.stdout.split() == ["M\\xfcller", "\\u2192", "\\u0410"]


@pytest.mark.slow
def test_a_missing_file_with_umlauts_under_such_a_locale(tmp_path):
    with unchanged(tmp_path):
        run = python("-m", "ptae_lite", "evaluate", "gewählt.safetensors", cwd=tmp_path, **NO_UTF8)
    assert run.returncode == 1 and "Traceback" not in run.stderr
    assert run.stderr.startswith("evaluate: gew") and "is missing; train a model" in run.stderr


def test_a_python_that_is_newer_than_pybullet(monkeypatch):
    new = SimpleNamespace(version_info=(3, 14, 0), platform="linux", executable=sys.executable,
                          implementation=sys.implementation)  # fmt: skip
    monkeypatch.setattr(doctor, "sys", new)
    assert doctor.check_python((3, 14, 0)).state == doctor.GOOD
    assert not set(doctor.SIMULATORS) & set(doctor.pins(ROOT / "environment.txt"))
    found = doctor.check_pybullet(works=lambda: False)
    assert found.state == doctor.WARNING and "all chapters run from what is stored" in found.says


def test_no_source_uses_what_a_newer_python_warns_of():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for path in [*ROOT.glob("src/**/*.py"), ROOT / "run.py"]:
            compile(path.read_text("utf-8"), str(path), "exec")
