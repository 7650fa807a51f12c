"""A folder that was moved or copied runs its own library, by every way that starts a Python."""

import os
import shutil
import subprocess
import sys

import pytest

import ptae_lite
from ptae_lite.artefacts import ROOT
from ptae_lite.book import installation

WHERE = "import ptae_lite; print(ptae_lite.__file__)"


def shown(*command, cwd=None):
    env = {name: text for name, text in os.environ.items() if not name.startswith("PYTHON")}
    done = subprocess.run(
        [str(part) for part in command], cwd=cwd, env=env, capture_output=True, text=True
    )
    return done.stdout.strip() or done.stderr.strip()


@pytest.fixture(scope="module")
def project(tmp_path_factory):
    """A small project with a real environment, and in it a program as pip would write it."""
    root = tmp_path_factory.mktemp("made") / "project"
    for name in ("__init__.py", "book/__init__.py", "book/installation.py"):
        path = root / "src" / "ptae_lite" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(ROOT / "src/ptae_lite" / name, path)
    python = root / ".venv/bin/python"
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", root / ".venv"], check=True)
    install(root)
    program = python.with_name("where")
    program.write_text(f"#!{python}\n{WHERE}\n")
    program.chmod(0o755)
    return root


def install(root, *options):
    script = root / "src/ptae_lite/book/installation.py"
    subprocess.run([root / ".venv/bin/python", script, *options], check=True)


pytestmark = pytest.mark.skipif(os.name == "nt", reason="the folders of Windows have other names")


@pytest.mark.parametrize("name", ["elsewhere", "in a folder with spaces", "x" * 130])
@pytest.mark.parametrize("how", ["moved", "copied"])
def test_a_folder_elsewhere_runs_its_own_library(project, how, name, tmp_path):
    before, root = project, tmp_path / name
    if how == "moved":
        before = tmp_path / "before"
        shutil.copytree(project, before, symlinks=True)
        install(before, "--from", project)
        before.rename(root)
    else:
        shutil.copytree(project, root, symlinks=True)
    own = str(root / "src/ptae_lite/__init__.py")
    assert shown(root / ".venv/bin/python", "-c", WHERE, cwd=root) == own  # at once
    install(root, "--from", before)
    assert shown(root / ".venv/bin/where", cwd=root) == own
    assert os.access(root / ".venv/bin/where", os.X_OK)
    activated = shown("sh", "-c", '. .venv/bin/activate && python -c "$0"', WHERE, cwd=root)
    assert activated == own
    theirs = str(project / "src/ptae_lite/__init__.py")
    assert shown(project / ".venv/bin/where", cwd=project) == theirs  # and the other is as it was


@pytest.mark.parametrize("line", ["export A={}", 'A="{}"', "A=$(echo {})", "A='{}'"])
def test_a_shell_reads_the_new_path_as_one_word(line, tmp_path):
    """Python 3.13 writes a path without blanks bare into `activate`."""
    old, new = tmp_path / "old", tmp_path / "two words"
    programs = new / "programs"
    programs.mkdir(parents=True)
    (programs / "activate").write_text(line.format(old / ".venv") + "\n")
    installation.settle(programs, old, new)
    read = shown("sh", "-c", '. programs/activate && echo "$A"', cwd=new)
    assert read == str(new / ".venv")


def test_a_launcher_that_starts_another_python_goes(tmp_path):
    """On Windows a program is a binary with the path of its Python in it."""
    old, new = tmp_path / "old", tmp_path / "new"
    new.mkdir()
    (new / "pytest.exe").write_bytes(b"MZ\0#!" + os.fsencode(old / ".venv/Scripts/python.exe"))
    (new / "ruff.exe").write_bytes(b"MZ\0 needs no Python")
    installation.settle(new, old, new)
    assert [path.name for path in new.iterdir()] == ["ruff.exe"]


def test_the_library_of_another_folder_is_refused(project):
    """Such as of a hub's own Python, into which the first of two clones was installed."""
    said = shown(sys.executable, "-m", "ptae_lite", "--help", cwd=project)
    assert f"{project} has a ptae_lite of its own" in said and "Traceback" not in said
    book = project / "book"
    book.mkdir()
    said = shown(sys.executable, "-c", WHERE, cwd=book)
    assert said.splitlines()[-1].startswith(f"ImportError: {project} has a ptae_lite of its own")


def test_a_folder_without_a_library_is_no_matter(tmp_path):
    assert shown(sys.executable, "-c", WHERE, cwd=tmp_path) == ptae_lite.__file__
