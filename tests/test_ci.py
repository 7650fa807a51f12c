"""The recipe for a fork's runners: commands that exist, caches that go by the right files."""

import importlib
import importlib.util
import json
import os
import re
from pathlib import Path

import pytest
import yaml

from ptae_lite.book import doctor

ROOT = Path(__file__).resolve().parents[1]
FILE = ROOT / ".github" / "workflows" / "book.yml"
TEXT = FILE.read_text("utf-8")
RECIPE = yaml.safe_load(TEXT)
JOBS = RECIPE["jobs"]

spec = importlib.util.spec_from_file_location("run", ROOT / "run.py")
run = importlib.util.module_from_spec(spec)
spec.loader.exec_module(run)


def steps(kind: str):
    return [(name, step) for name, job in JOBS.items() for step in job["steps"] if kind in step]


def understood(arguments):
    """Ends the test where `run.py` or the module of its job would not take them."""
    job, given = run.parse(arguments)
    module = doctor if job == "doctor" else importlib.import_module(run.JOBS[job][0])
    own = given[: given.index("--")] if "--" in given else given
    module.parser().parse_args(own)


def test_every_command_is_one_of_ours():
    commands = [line for _, step in steps("run") for line in step["run"].splitlines()
                if "run.py" in line]  # fmt: skip
    assert len(commands) >= 5
    for command in commands:
        python, script, *arguments = command.split()
        assert (python, script) == ("python", "run.py")
        understood(arguments)


def test_the_jobs_are_there():
    assert set(JOBS) == {"test", "systems", "without-pybullet", "newest-python", "full"}
    assert "cron" in RECIPE[True]["schedule"][0]  # YAML reads the key `on` as a truth
    assert RECIPE["permissions"] == {"contents": "read"}
    assert any(step["run"] == "python run.py full --seeds 1" for _, step in steps("run"))
    assert JOBS["newest-python"]["steps"][1]["with"]["python-version"] == "3.x"
    assert all(job["timeout-minutes"] <= 360 for job in JOBS.values())


def test_every_python_with_pybullet_is_tried_and_each_system():
    (python,) = (step["with"]["python-version"] for _, step in steps("uses")
                 if _ == "test" and "setup-python" in step["uses"])  # fmt: skip
    tried = [(one["os"], one["python"]) for one in JOBS["systems"]["strategy"]["matrix"]["include"]]
    on_linux = {version for system, version in tried if system.startswith("ubuntu")}
    assert on_linux | {python} == {"3.11", "3.12", "3.13"}
    assert {system.split("-")[0] for system, _ in tried} == {"ubuntu", "macos", "windows"}


def test_caches_go_by_the_files_that_decide_what_they_hold():
    caches = [step["with"] for _, step in steps("uses") if step["uses"].startswith("actions/cache")]
    assert {cache["path"] for cache in caches} == {".venv", "build/full"}
    for cache in caches:
        assert "environment.txt" in cache["key"]
        if cache["path"] == "build/full":
            assert "data/MANIFEST.json" in cache["key"] and "src/" in cache["key"]


def test_no_address_stands_in_it():
    assert not re.search(r"https?://|\.org/|pypi", TEXT)


@pytest.mark.parametrize(
    "name",
    ["environment.txt", "pyproject.toml", "README.md", "CHANGELOG.md", "run.py", ".ci/lock.toml",
     "book/setup.md", "Containerfile", ".devcontainer/devcontainer.json", ".binder/postBuild"],
)  # fmt: skip
def test_no_address_of_a_registry_stands_in_what_installs(name):
    text = (ROOT / name).read_text("utf-8")
    assert not re.search(r"--(extra-)?index-url|--find-links|pypi\.|docker\.io|mcr\.|ghcr\.", text)


def test_the_dev_container_begins_with_a_stage_that_there_is():
    recipe = json.loads((ROOT / ".devcontainer/devcontainer.json").read_text("utf-8"))
    container = (ROOT / ".devcontainer" / recipe["build"]["dockerfile"]).resolve()
    text = container.read_text("utf-8").split(f"AS {recipe['build']['target']}\n")[1]
    assert f"{recipe['remoteUser']}\n" in text.split("FROM")[0]  # its last word makes the user
    python, *arguments = recipe["postCreateCommand"].split()
    assert python == "python3"
    understood(arguments[1:])


def test_recipes_name_a_python_with_pybullet_and_files_that_exist():
    texts = [
        (ROOT / name).read_text("utf-8")
        for name in ("Containerfile", ".binder/runtime.txt", ".binder/postBuild", "book/setup.md")
    ]
    pythons = [*re.findall(r"python[:-](\S*?\d)(?:-|$)", "\n".join(texts[:2]), re.M)]
    assert len(pythons) == 2 and set(pythons) <= {"3.11", "3.12", "3.13"}
    files = re.findall(r"(?:COPY|-r|python) ([\w./]+\.(?:txt|py))", "\n".join(texts))
    assert {
        "environment.txt",
        "src/ptae_lite/book/doctor.py",
        "src/ptae_lite/live/scripts.py",
    } == set(files)
    assert all((ROOT / name).is_file() for name in files)
    if os.name != "nt":
        assert os.access(ROOT / ".binder/postBuild", os.X_OK)


def test_without_pybullet_means_neither_package():
    (line,) = (step["run"] for _, step in steps("run") if "uninstall" in step["run"])
    assert set(doctor.SIMULATORS) <= set(line.split())
