"""The benchmark's table: values beside limits, and what was measured or only extrapolated."""

import importlib.util
import json
import os
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import pandas as pd
import pytest

FOLDER = Path(__file__).resolve().parents[1] / "benchmarks"


@pytest.fixture
def run(monkeypatch):
    """The script as a module; it finds its own folder's modules as when it is run."""
    monkeypatch.syspath_prepend(str(FOLDER))
    spec = importlib.util.spec_from_file_location("benchmarks_run", FOLDER / "run.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture
def made(run, monkeypatch):
    """Jobs that take no time: one within its limit, one without a value."""
    good = run.Row("speed", 2).extrapolate([1.0, 3.0, 2.0], 30, "3 of 30")
    right = run.Row("right", 95, "%", 94.9, at_most=False)
    jobs = {"fast": lambda options: [good, right], "none": lambda options: [run.Row("x", 1, "s")]}
    monkeypatch.setattr(run, "JOBS", jobs)
    return jobs


def test_a_part_is_extrapolated_to_the_whole(run):
    row = run.Row("a", 2).extrapolate([60.0, 6.0, 12.0], 10, "3 of 10 steps")
    assert (row.value, row.low, row.high) == (2, 1, 10)
    assert row.how == "extrapolated from 3 of 10 steps"


@pytest.mark.parametrize(
    ("value", "at_most", "holds"),
    [(9.9, True, True), (10, True, True), (10.1, True, False), (None, True, None),
     (9.9, False, False), (10, False, True)],
)  # fmt: skip
def test_a_limit_holds_or_not(run, value, at_most, holds):
    assert run.Row("a", 10, value=value, at_most=at_most).holds is holds


def test_the_table_is_markdown(run, made, capsys):
    assert run.main([]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[2:5] == [
        "| speed | 1.0 min | 0.5 to 1.5 | ≤ 2 min | yes | extrapolated from 3 of 30 |",
        "| right | 94.9 % |  | ≥ 95 % | NO | measured |",
        "| x |  |  | ≤ 1 s | ? | measured |",
    ]
    assert len({line.count("|") for line in lines[:5]}) == 1
    assert "cores: " in lines[6]


def test_json_holds_the_same_rows_and_the_machine(run, made, capsys):
    assert run.main(["fast", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert [row["holds"] for row in found["rows"]] == [True, False]
    assert found["rows"][0]["value"] == 1 and found["machine"]["python"]


def test_an_unknown_name_is_refused_with_those_there_are(run, capsys):
    with pytest.raises(SystemExit):
        run.main(["speed"])
    assert "no measure 'speed'; there are recording, cae, cae_step" in capsys.readouterr().err


@pytest.mark.slow
def test_the_fast_step_of_a_cae_is_measured_beside_the_readable_one(run, monkeypatch):
    monkeypatch.setattr(run, "WARM_UP", 1)
    monkeypatch.setattr(run, "CAE_STEPS", 3)
    rows = run.cae_step(SimpleNamespace(full=False))
    assert [row.measure.split()[0] for row in rows] == ["separated", "plain"]
    for row in rows:
        assert 0.3 < row.low <= row.value <= row.high < 30 and not row.at_most


@pytest.mark.slow
def test_a_step_of_each_model_is_measured_as_training_takes_it(run, monkeypatch):
    module = sys.modules[run.steps.__module__]
    monkeypatch.setattr(module, "STEPS", 2)
    monkeypatch.setattr(module, "WARM_UP", 1)
    rows = run.steps(SimpleNamespace(full=False))
    assert [row.measure.split(",")[0] for row in rows] == ["PTAE", "PTAE", "PGAE"]
    for row in rows:
        assert 0 < row.low <= row.value <= row.high and not row.at_most


@pytest.mark.slow
def test_describing_ends_when_its_training_does(run, monkeypatch):
    monkeypatch.setattr(sys.modules[run.describing.__module__], "SHORT_EPOCHS", 2)
    (row,) = run.describing(SimpleNamespace(full=False, authors=None))
    assert row.value is None and row.how == "not reached in 2 epochs"


def test_memory_is_that_of_the_process_at_its_largest(run):
    if not hasattr(os, "wait4"):
        pytest.skip("this system does not tell a process's memory")
    little, much = (
        run.peak_gb([sys.executable, "-c", f"x = bytearray(b'1' * {n}); del x"])
        for n in (1, 50_000_000)
    )
    assert 0.05 < much - little < 0.125
    assert run.peak_gb([sys.executable, "-c", "1 / 0"]) is None


def test_memory_of_a_cae_is_not_measured_without_a_recording(run, monkeypatch, tmp_path):
    asked = []
    monkeypatch.setattr(run, "peak_gb", lambda command: asked.append(command) or 1.5)
    rows = run.memory(SimpleNamespace(data=tmp_path / "none"))
    assert [row.value for row in rows] == [None, None, 1.5, 1.5, 1.5, 1.5]
    assert "first run python -m ptae_lite record" in rows[0].how and rows[2].holds
    assert [command[4] for command in asked] == ["ptae", "pgae", "pvae", "prae"]
    rows = run.memory(SimpleNamespace(data=tmp_path))
    assert all(row.value == 1.5 for row in rows) and "--data" in asked[4]


def test_chapters_are_read_from_the_last_build(run, tmp_path):
    quick = SimpleNamespace(full=False)
    missing, whole = run.chapters(quick, tmp_path)
    assert missing.value is None and "first run python3 run.py book" in missing.how
    assert whole.value is None and "needs --full" in whole.how
    (tmp_path / "build").mkdir()
    times = {
        "02_b": {"seconds": 61.0, "traceback": ""},
        "01_a": {"seconds": 7.5, "traceback": ""},
        "03_c": {"seconds": 1.0, "traceback": "Traceback ..."},
    }
    (tmp_path / "build" / "chapter_times.json").write_text(json.dumps(times))
    rows = run.chapters(quick, tmp_path)[:-1]
    assert [(row.measure, row.holds) for row in rows] == [
        ("chapter 01_a", True), ("chapter 02_b", False), ("chapter 03_c", None),
    ]  # fmt: skip
    assert "failed" in rows[2].how


def test_every_action_is_in_the_recorded_part_once(run):
    from ptae_lite.language import patterns

    chosen = [patterns()[i] for some in run.RECORDED for i in some]
    assert sorted(p.action_index for p in chosen) == list(range(12))
    assert {sum(patterns()[i].frames for i in some) for some in run.RECORDED} == {300}


@pytest.mark.slow
def test_no_simulator_without_a_recording():
    code = (
        "import sys; sys.path.insert(0, 'benchmarks'); import run;"
        "assert run.main(['chapters']) == 0; assert 'pybullet' not in sys.modules"
    )
    subprocess.run([sys.executable, "-c", code], cwd=FOLDER.parent, check=True, capture_output=True)


def test_stored_rows_say_machine_and_date(run, made, tmp_path, monkeypatch):
    from ptae_lite import artefacts

    monkeypatch.setattr(artefacts, "data_folder", lambda: tmp_path)
    (tmp_path / "results").mkdir()
    assert run.main(["fast", "none", "--store"]) == 0
    table = pd.read_csv(artefacts.stored("results/benchmarks.csv"))
    assert table["measure"].tolist() == ["speed", "right", "x"]
    assert table["value"].tolist()[:2] == [1.0, 94.9] and not table["holds"][1]
    assert table[["system", "cores", "python", "load before", "date"]].notna().all(axis=None)
    entry = artefacts.manifest()["results/benchmarks.csv"]
    assert entry["command"] == "python benchmarks/run.py fast none --store"
