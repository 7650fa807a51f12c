"""Nothing is let in: nothing of ours listens, no code runs from data, reading writes nothing."""

import ast
import json
import subprocess
import sys
from pathlib import Path

import pytest
from watch import ROOT, contents, environment, finish, sockets_of, start, until, until_said

SOURCES = [*ROOT.glob("src/**/*.py"), *ROOT.glob("benchmarks/*.py"), ROOT / "run.py",
           ROOT / "book" / "conf.py"]  # fmt: skip
RUNS_DATA = {"pickle", "cPickle", "dill", "cloudpickle", "marshal", "shelve"}
RUNS_TEXT = {"eval", "exec", "compile", "__import__", "torch.load", "joblib.load", "yaml.load",
             "pd.read_pickle", "torch.hub.load", "torch.jit.load"}  # fmt: skip
LISTENS = {"http", "socketserver", "xmlrpc", "wsgiref", "flask", "aiohttp", "tornado", "socket"}


def nodes(kind, sources=SOURCES):
    for path in sources:
        for node in ast.walk(ast.parse(path.read_text("utf-8"))):
            if isinstance(node, kind):
                yield path.name, node


def imported(sources=SOURCES) -> set[tuple[str, str]]:
    """(file, first part of a module's name) of every import."""
    found = {(path, node.module or "") for path, node in nodes(ast.ImportFrom, sources)}
    found |= {
        (path, alias.name) for path, node in nodes(ast.Import, sources) for alias in node.names
    }
    return {(path, name.split(".")[0]) for path, name in found}


def calls(sources=SOURCES) -> list[tuple[str, str, list[str]]]:
    """(file, what is called, the texts of its keywords) of every call."""
    return [
        (path, ast.unparse(node.func), [ast.unparse(keyword) for keyword in node.keywords])
        for path, node in nodes(ast.Call, sources)
    ]


def lets_in(sources=SOURCES) -> list[str]:
    """Modules and calls that run what they read, and arrays that may hold objects."""
    found = [name for _, name in sorted(imported(sources)) if name in RUNS_DATA]
    for _, name, keywords in calls(sources):
        objects = [word for word in keywords if word.startswith("allow_pickle=")]
        safe = objects in ([], ["allow_pickle=False"])
        found += [name] if name in RUNS_TEXT or (name == "np.load" and not safe) else []
    return found


@pytest.mark.slow
def test_nothing_runs_what_it_reads():
    assert "np.load" in {name for _, name, _ in calls()}
    assert lets_in() == []


@pytest.mark.parametrize(
    ("line", "found"),
    [
        ("import marshal", ["marshal"]),
        ("from shelve import open", ["shelve"]),
        *((f"{name}(path)", [name]) for name in sorted(RUNS_TEXT)),
        ("np.load(path, allow_pickle=anything)", ["np.load"]),
        ("np.load(path, allow_pickle=False)", []),
        ("np.load(path)", []),
    ],
)
def test_the_scan_finds_what_it_looks_for(tmp_path, line, found):
    (tmp_path / "one.py").write_text(line)
    assert lets_in([tmp_path / "one.py"]) == found


def test_no_server_is_written_and_the_viewers_own_is_never_started():
    assert not {(path, name) for path, name in imported() if name in LISTENS}
    names = [name for _, name, _ in calls()]
    assert not [
        name for name in names if name.split(".")[-1] in ("listen", "bind", "serve_forever")
    ]
    made = [keywords for _, name, keywords in calls() if name.split(".")[-1] == "Visualizer"]
    assert all(any(word.startswith("window=") for word in keywords) for keywords in made)


def test_jupyterlab_and_the_tests_server_are_for_this_machine_alone():
    texts = [*SOURCES, *ROOT.glob("tests/*.py"), *ROOT.glob("book/*.md")]
    for path in texts:
        text = path.read_text("utf-8")
        assert "--ip=0" not in text and "0.0.0.0" not in text, path
        for place in text.split("--ip=")[1:]:
            assert place.startswith("127.0.0.1"), path


@pytest.fixture(scope="module")
def reader(tmp_path_factory):
    """What a reader's run did, in a folder of its own, and what it said."""
    folder = tmp_path_factory.mktemp("reader")
    before = contents(ROOT / "data")
    run = subprocess.run(
        [sys.executable, str(Path(__file__).with_name("reader.py")), str(folder / "report.json")],
        env=environment(PYTHONDONTWRITEBYTECODE="1"), cwd=folder, capture_output=True, text=True,
    )  # fmt: skip
    assert run.returncode == 0, run.stderr
    assert contents(ROOT / "data") == before
    return json.loads((folder / "report.json").read_text()) | {"said": run.stderr, "at": folder}


@pytest.mark.slow
def test_reading_data_writes_no_file(reader):
    assert reader["watched"]
    assert reader["written"] == []


def test_reading_data_opens_no_connection_and_needs_no_network(reader):
    assert reader["sockets"] == []


def test_reading_data_starts_no_process(reader):
    assert reader["processes"] == []


def test_reading_data_unpickles_nothing_and_runs_no_text_as_code(reader):
    assert reader["unpickled"] == []
    # The standard library makes classes of named tuples and dataclasses from checked names.
    makers = {"collections.namedtuple", "dataclasses.add_fns_to_class"}
    assert set(reader["executed"]) <= makers


def test_without_pybullet_all_is_read_and_only_recording_is_refused(reader):
    assert reader["record"] == 1
    assert "record: PyBullet is not installed, so nothing can be recorded" in reader["said"]
    assert [path.name for path in reader["at"].iterdir()] == ["report.json"]  # nothing was begun


@pytest.mark.slow
def test_nothing_listens_while_two_workers_record(simulator, tmp_path):
    process = start("record", tmp_path / "r", 2)
    until(process, lambda: list((tmp_path / "r").glob("sequences/*.npz")))
    assert not sockets_of(process)
    assert finish(process)[0] == 0


@pytest.mark.slow
def test_nothing_listens_while_a_study_has_two_workers():
    process = start("naps", 20)
    until_said(process, 2)
    assert not sockets_of(process)
    assert finish(process)[0] == 0
