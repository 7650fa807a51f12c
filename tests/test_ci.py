"""The recipe for a fork's runners: commands that exist, caches that go by the right files."""

import importlib.util
import re
from pathlib import Path

import pytest
import yaml

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


def test_every_command_is_one_of_ours():
    commands = [line for _, step in steps("run") for line in step["run"].splitlines()
                if "run.py" in line]  # fmt: skip
    assert len(commands) >= 5
    for command in commands:
        python, script, *arguments = command.split()
        assert (python, script) == ("python", "run.py")
        assert run.parse(arguments)


def test_the_jobs_are_there():
    assert set(JOBS) == {"test", "without-pybullet", "newest-python", "full"}
    assert "cron" in RECIPE[True]["schedule"][0]  # YAML reads the key `on` as a truth
    assert RECIPE["permissions"] == {"contents": "read"}
    assert any(step["run"] == "python run.py full --seeds 1" for _, step in steps("run"))
    assert JOBS["newest-python"]["steps"][1]["with"]["python-version"] == "3.x"
    assert all(job["timeout-minutes"] <= 360 for job in JOBS.values())


def test_caches_go_by_the_files_that_decide_what_they_hold():
    caches = [step["with"] for _, step in steps("uses") if step["uses"].startswith("actions/cache")]
    assert {cache["path"] for cache in caches} == {".venv", "build/full"}
    for cache in caches:
        assert "environment.txt" in cache["key"]
        if cache["path"] == "build/full":
            assert "data/MANIFEST.json" in cache["key"] and "src/" in cache["key"]


def test_no_address_stands_in_it():
    assert not re.search(r"https?://|\.org/|pypi", TEXT)


@pytest.mark.parametrize("name", ["environment.txt", "README.md", "CHANGELOG.md", "run.py"])
def test_no_address_of_a_registry_stands_in_what_installs(name):
    text = (ROOT / name).read_text("utf-8")
    assert not re.search(r"--(extra-)?index-url|--find-links|pypi\.", text)


def test_pybullet_is_taken_out_by_its_line():
    (sed,) = (step["run"] for _, step in steps("run") if step["run"].startswith("sed"))
    pattern = re.search(r"/(.+)/d", sed)[1]
    lines = (ROOT / "environment.txt").read_text("utf-8").splitlines()
    assert [line.split("==")[0] for line in lines if re.match(pattern, line)] == ["pybullet"]
