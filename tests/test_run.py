"""The entry script: its conditions, what makes it install again, and what it prints."""

import importlib.util
import os
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path
from types import SimpleNamespace

import pytest

from ptae_lite.book import machine as doctor_machine
from ptae_lite.book import site, testing

ROOT = Path(__file__).resolve().parents[1]
spec = importlib.util.spec_from_file_location("run", ROOT / "run.py")
run = importlib.util.module_from_spec(spec)
spec.loader.exec_module(run)


@pytest.fixture
def root(tmp_path):
    """A repository with an empty virtual environment, as far as the script can see."""
    (tmp_path / "environment.txt").write_text("numpy==1.0\n")
    (tmp_path / "pyproject.toml").write_text("[project]\n")
    for name in ("package.json", "package-lock.json"):
        (tmp_path / name).write_text("{}\n")
    (tmp_path / ".venv").mkdir()
    (tmp_path / ".venv" / "pyvenv.cfg").write_text("home = here\nversion = 3.11.7\n")
    return tmp_path


@pytest.fixture
def calls(monkeypatch, root):
    """The commands that would have run; each succeeds, and making the .venv/ makes it."""
    commands = []

    def call(command, env, **streams):
        commands.append([str(part) for part in command])
        if "venv" in commands[-1]:
            run.venv_python(root).parent.mkdir(parents=True)
            run.venv_python(root).touch()
        return 0

    monkeypatch.setattr(run, "ROOT", root)
    monkeypatch.setattr(run, "call", call)
    monkeypatch.setattr(run.shutil, "which", lambda name: None)
    return commands


def is_one_sentence(text):
    return text.endswith(".") and "\n" not in text and "Traceback" not in text


# ---------------------------------------------------------------- conditions


@pytest.mark.parametrize("version", [(3, 11), (3, 11, 2), (3, 12, 1), (3, 13), (4, 0)])
def test_new_enough(version):
    run.check_python(version)


@pytest.mark.parametrize("version", [(3, 10, 13), (3, 9), (2, 7, 18)])
def test_too_old(version):
    with pytest.raises(run.Stop, match=rf"3\.11 or newer.* {version[0]}\.{version[1]}\.") as stop:
        run.check_python(version)
    assert is_one_sentence(str(stop.value))


@pytest.mark.parametrize("missing", ["venv", "ensurepip"])
def test_no_virtual_environments(missing):
    with pytest.raises(run.Stop, match=f"module {missing} is missing.*python3-venv"):
        run.check_venv_modules(find=lambda name: None if name == missing else "found")
    run.check_venv_modules(find=lambda name: "found")


def test_disk():
    run.check_disk(20e9)
    with pytest.raises(run.Stop, match=r"6 GB .* 1\.5 GB") as stop:
        run.check_disk(1.5e9)
    assert is_one_sentence(str(stop.value))


def test_a_condition_that_fails_ends_in_one_sentence(monkeypatch, capsys):
    monkeypatch.setattr(run, "check_python", lambda version: (_ for _ in ()).throw(run.Stop("No.")))
    assert run.main(["book"]) == 1
    assert capsys.readouterr().err == "No.\n"


# ---------------------------------------------------------------- the environment


def test_first_installation_makes_the_environment_once(calls, root, capsys):
    python = run.ensure_environment({}, root)
    assert [command[1:3] for command in calls[:2]] == [["-m", "venv"], ["-m", "pip"]]
    assert calls[1][-2:] == ["-r", "environment.txt"]
    assert (run.ROOT / calls[2][-1]).name == "installation.py"
    assert "Installing environment.txt" in capsys.readouterr().out

    assert run.ensure_environment({}, root) == python
    assert (run.ROOT / calls[3][-1]).name == "scripts.py"
    assert len(calls) == 5  # the fifth looks for PyBullet; nothing changed, nothing done

    (root / "environment.txt").write_text("numpy==2.0\n")
    run.ensure_environment({}, root)
    assert len(calls) == 9  # all installations again, the environment itself stays


def test_a_new_python_gets_packages_of_its_own(calls, root):
    """Python was replaced by a newer one: its link leads nowhere, and no package is of its own."""
    run.ensure_environment({}, root)
    run.venv_python(root).unlink()
    (root / ".venv" / "pyvenv.cfg").write_text("version = 3.13.0\n")  # as the new one writes it
    shutil.rmtree(run.venv_python(root).parent)
    del calls[:]
    run.ensure_environment({}, root)
    assert "--clear" in calls[0] and len(calls) == 5


def test_an_environment_that_was_moved_is_made_to_fit_and_said_to_be(calls, root, capsys):
    run.ensure_environment({}, root)
    elsewhere = root.rename(root.with_name(f"{root.name} elsewhere"))
    del calls[:]
    run.ensure_environment({}, elsewhere)
    ((python, script, *options),) = calls  # nothing is downloaded
    assert python == str(run.venv_python(elsewhere)) and script == str(run.INSTALLATION)
    assert options == ["--from", str(root)] and str(root) in capsys.readouterr().out
    run.ensure_environment({}, elsewhere)
    assert len(calls) == 1  # once


def test_what_cannot_be_made_to_fit_is_tried_again(calls, root, monkeypatch):
    run.ensure_environment({}, root)
    elsewhere = root.rename(root.with_name(f"{root.name} elsewhere"))
    del calls[:]
    monkeypatch.setattr(run, "call", lambda command, env: calls.append(command) or 1)  # read-only
    for times in (1, 2):
        run.ensure_environment({}, elsewhere)
        assert len(calls) == times


def test_line_ends_make_no_other_environment(root):
    before = run.fingerprint(root)
    (root / "environment.txt").write_bytes(b"numpy==1.0\r\n")
    assert run.fingerprint(root) == before


def test_a_failed_installation_is_tried_again(calls, root, monkeypatch):
    run.venv_python(root).parent.mkdir(parents=True)
    run.venv_python(root).touch()
    run.ensure_environment({}, root)
    assert run.is_installed(root)
    before = (root / "environment.txt").read_text()
    (root / "environment.txt").write_text("numpy==2.0\n")
    monkeypatch.setattr(run, "call", lambda command, env, **streams: 1)
    with pytest.raises(run.Stop, match="could not be installed"):
        run.ensure_environment({}, root)
    (root / "environment.txt").write_text(before)  # what is installed now may be a mixture
    assert not run.is_installed(root)


def test_half_an_environment_is_not_kept(calls, root, monkeypatch):
    monkeypatch.setattr(run, "call", lambda command, env, **streams: 1)
    with pytest.raises(run.Stop, match="could not be made"):
        run.ensure_environment({}, root)
    assert not (root / ".venv").exists()


def test_too_little_space_stops_before_anything_is_made(calls, root, monkeypatch):
    monkeypatch.setattr(run.shutil, "disk_usage", lambda path: SimpleNamespace(free=1e9))
    with pytest.raises(run.Stop, match="free disk space"):
        run.ensure_environment({}, root)
    assert calls == []


def test_an_environment_of_an_old_python_is_refused(calls, root):
    (root / ".venv" / "pyvenv.cfg").write_text("version_info = 3.9.1.final.0\n")
    run.venv_python(root).parent.mkdir(parents=True)
    run.venv_python(root).touch()
    with pytest.raises(run.Stop, match=r"the one in \.venv/ .* is 3\.9"):
        run.ensure_environment({}, root)


def test_an_environment_of_another_new_python_is_used(calls, root):
    (root / ".venv" / "pyvenv.cfg").write_text("version = 3.13.0\n")
    run.venv_python(root).parent.mkdir(parents=True)
    run.venv_python(root).touch()
    assert run.ensure_environment({}, root) == run.venv_python(root)


@pytest.mark.parametrize("there", [True, False])
def test_what_is_missed_without_pybullet_is_said(there, calls, root, monkeypatch, tmp_path, capsys):
    """By whether the environment has the module, and not by its version of Python."""
    if there:
        (tmp_path / "pybullet.py").write_text("1 / 0")  # it is looked for, and not imported

    def call(command, env, **streams):
        if run.FIND_PYBULLET not in command:
            return 0
        bare = [sys.executable, "-I", "-S", "-c", "import sys; sys.path.append(sys.argv[1]); "]
        return subprocess.run([*bare[:-1], bare[-1] + command[-1], tmp_path]).returncode

    monkeypatch.setattr(run, "call", call)
    run.venv_python(root).parent.mkdir(parents=True)
    run.venv_python(root).touch()
    run.ensure_environment({}, root)
    assert ("nothing can be recorded" in capsys.readouterr().out) is not there


@pytest.mark.parametrize("works", [True, False])
def test_without_the_scripts_of_others_the_book_is_made_and_says_so(
    works, calls, root, monkeypatch, capsys
):
    def call(command, env, **streams):
        failed = run.SCRIPTS in command and not works
        return 1 if failed else made(command, env, **streams)

    made = run.call
    monkeypatch.setattr(run, "call", call)
    run.ensure_environment({}, root)
    assert (run.NO_SCRIPTS in capsys.readouterr().out) is not works
    assert run.is_installed(root)  # no job waits for a network again


@pytest.mark.parametrize(
    "name", ["environment.txt", "pyproject.toml", "package.json", "package-lock.json"]
)
def test_the_fingerprint_covers(name, root):
    before = run.fingerprint(root)
    (root / name).write_text("other\n")
    assert run.fingerprint(root) != before


def test_uv_is_told_which_python_to_install_into():
    with_uv, without = (run.install_commands(Path("py"), uv)[0] for uv in ("uv", None))
    assert with_uv[:3] == ["uv", "pip", "install"] and "py" in with_uv
    assert without[:4] == ["py", "-m", "pip", "install"]


def test_python_in_the_environment():
    assert run.venv_python(Path("r"), windows=True) == Path("r/.venv/Scripts/python.exe")
    assert run.venv_python(Path("r"), windows=False) == Path("r/.venv/bin/python")


def test_children_get_fixed_settings():
    env = run.child_environment({"HOME": "h", "OMP_NUM_THREADS": "8", "PIP_FIND_LINKS": "wheels"})
    assert (env["HOME"], env["OMP_NUM_THREADS"]) == ("h", "1")
    assert (env["PYTHONHASHSEED"], env["UV_FIND_LINKS"]) == ("0", "wheels")
    for given, tier in ({"PTAE_TIER": "quick"}, "quick"), ({"PTAE_TIER": ""}, "replay"):
        assert run.child_environment(given)["PTAE_TIER"] == tier


def test_children_do_not_get_what_another_project_set():
    foreign = {name: "x" for name in run.FOREIGN}
    env = run.child_environment(foreign | {"PATH": "p", "PYTHONDONTWRITEBYTECODE": "1"})
    assert not env.keys() & foreign.keys()
    assert (env["PATH"], env["PYTHONDONTWRITEBYTECODE"]) == ("p", "1")
    assert {*doctor_machine.FOREIGN, "VIRTUAL_ENV"} == {*run.FOREIGN}  # it names the same


@pytest.mark.slow
def test_a_foreign_python_path_does_not_reach_pytest(tmp_path):
    """As with ROS: a package on the path registers a plugin with a hook that pytest lacks."""
    ros, tests = tmp_path / "ros", tmp_path / "tests"
    about = ros / "launch-1.0.dist-info"
    about.mkdir(parents=True)
    (about / "METADATA").write_text("Metadata-Version: 2.1\nName: launch\nVersion: 1.0\n")
    (about / "entry_points.txt").write_text("[pytest11]\nlaunch = launch_plugin\n")
    (ros / "launch_plugin.py").write_text("def pytest_launch_collect_makemodule(): ...\n")
    tests.mkdir()
    (tests / "test_it.py").write_text("def test_it(): ...\n")
    (tests / "pytest.ini").write_text("[pytest]\n")
    given = dict(os.environ) | {"PYTHONPATH": str(ros)}

    def status(env):
        command = [sys.executable, "-m", "pytest", "-q"]
        return subprocess.run(command, env=env, cwd=tests, capture_output=True).returncode

    assert status(given) != 0 and status(run.child_environment(given)) == 0


def test_a_kernel_does_not_get_the_packages_of_another_environment(tmp_path):
    """IPython puts those of an active environment in front of its own."""
    code = "import sys; from IPython import start_ipython; start_ipython(['-c', sys.argv[1]])"
    shown = "import sys; print(sys.path[0])"
    for environ in (dict(os.environ), run.child_environment(dict(os.environ))):
        environ["IPYTHONDIR"] = str(tmp_path / "ipython")
    given = environ | {"VIRTUAL_ENV": str(tmp_path)}

    def path(env):
        command = [sys.executable, "-c", code, shown]
        return subprocess.run(command, env=env, capture_output=True, text=True).stdout

    assert str(tmp_path) in path(given)
    assert str(tmp_path) not in path(run.child_environment(given))


# ---------------------------------------------------------------- the jobs


@pytest.fixture
def environment(monkeypatch):
    """There is one, and nothing to install; its Python is this one."""
    monkeypatch.setattr(run, "ensure_environment", lambda env: Path(sys.executable))


PATH_JOBS = [job for job in run.JOBS if job not in ("lab", "test", "doctor")]


@pytest.mark.parametrize("job", run.JOBS)
def test_every_job_is_handed_what_follows_its_name(job, calls, environment):
    assert run.main([job, "--of-its-own", "x"]) == 0
    assert calls[0][-2:] == ["--of-its-own", "x"]
    if job == "doctor":
        assert (ROOT / calls[0][-3]).is_file()
    else:
        assert calls[0][1] == "-m" and importlib.util.find_spec(calls[0][2])


@pytest.mark.parametrize(("status", "ends"), [(0, 0), (2, 2), (-9, 1), (run.READER_GONE,) * 2])
def test_a_job_ends_as_its_module_did(status, ends, environment, monkeypatch):
    monkeypatch.setattr(run, "call", lambda *_: status)
    assert run.main(["book"]) == ends


@pytest.mark.parametrize("job", PATH_JOBS)
def test_paths_are_meant_from_where_the_reader_is(job, environment, monkeypatch, tmp_path):
    seen = []
    monkeypatch.setattr(run, "call", lambda command, env: seen.append(env) or 0)
    monkeypatch.chdir(tmp_path)
    run.main([job])
    monkeypatch.setattr(os, "environ", seen[0])
    monkeypatch.chdir(ROOT)  # where the job runs
    module = importlib.import_module(run.JOBS[job][0])
    given = {"course": ["mine"], "full": ["--out", "mine"], "certify": ["--out", "mine"],
             "book": ["--out", "mine"], "notebooks": []}[job]  # fmt: skip
    assert getattr(module.parser().parse_args(given), "out", tmp_path / "mine") == tmp_path / "mine"
    if job in ("full", "certify"):
        assert module.parser().parse_args([]).out.is_relative_to(ROOT / "build")
    if job == "certify":
        checked = module.parser().parse_args(["--check", "c.json", "/d.json"]).check
        assert checked == [tmp_path / "c.json", Path("/d.json")]


def test_the_help_lists_every_job_and_needs_no_environment(capsys, monkeypatch):
    monkeypatch.setattr(run, "ensure_environment", lambda env: 1 / 0)
    with pytest.raises(SystemExit) as ended:
        run.main(["--help"])
    shown = capsys.readouterr().out
    assert ended.value.code == 0
    assert all(f"  {name} " in shown and says in shown for name, (_, says) in run.JOBS.items())


@pytest.mark.parametrize("job", ["full", "test"])
def test_a_job_says_what_it_understands(job, capsys):
    module = importlib.import_module(run.JOBS[job][0])
    with pytest.raises(SystemExit):
        module.main(["--help"])
    assert f"usage: run.py {job} " in capsys.readouterr().out


def test_the_doctor_installs_nothing_and_needs_no_environment(calls, root, monkeypatch):
    monkeypatch.setattr(run, "ensure_environment", lambda env: 1 / 0)
    assert run.main(["doctor"]) == 0
    ((python, *_, script),) = calls
    assert python in (sys.executable, str(run.venv_python())) and (ROOT / script).is_file()
    monkeypatch.setattr(run, "venv_python", lambda: root / "environment.txt")  # a file that exists
    run.main(["doctor", "--line-endings"])
    assert calls[1][0] == str(root / "environment.txt") and "-E" in calls[1]  # it obeys no variable
    assert calls[1][-1] == "--line-endings"


JUNIT = (
    '<testsuites><testsuite errors="1" failures="{failures}" skipped="3" tests="20"/></testsuites>'
)


@pytest.fixture
def phases(monkeypatch, tmp_path):
    """A function: how pytest ends in each phase; it gives the list of the commands that ran."""
    ran = []

    def end(units=0, pages=0, cells=0, site=0):
        def call(module, *options, log=None):
            ran.append([module, *options])
            if module != "pytest":
                return site
            (junit,) = (word.split("=")[1] for word in map(str, options) if "junitxml" in word)
            status = cells if "--nbval-lax" in options else pages if "browser" in options else units
            if status != 4:  # 4: pytest did not come to its end
                Path(junit).write_text(JUNIT.format(failures=status))
            return status

        (tmp_path / "build").mkdir()
        monkeypatch.setattr(testing, "ROOT", tmp_path)
        monkeypatch.setattr(testing, "call", call)
        monkeypatch.setattr(testing, "ensure_extras", lambda: ran.append(["extras"]))
        return ran

    return end


def mark_of(command):
    return command[command.index("-m") + 1]


@pytest.mark.parametrize("units", [0, 1])
@pytest.mark.parametrize("cells", [0, 5])  # 5: no test was found
def test_the_quick_tests_need_no_site_and_end_in_a_line(units, cells, phases, capsys):
    ran = phases(units, cells=cells)
    assert testing.main([]) == int(bool(units or cells))
    assert len(ran) == 2
    assert mark_of(ran[0]).split(" and ") == [f"not {name}" for name in testing.NOT_QUICK]
    last = capsys.readouterr().out.splitlines()[-1]
    assert last.startswith("FAILED" if units or cells else "Passed")
    assert last.count("FAILED ") == bool(units or cells) + bool(units) + bool(cells)
    assert "16 passed" in last or units and cells
    assert "test --all" in last and all(name in last for name in testing.NOT_QUICK)


@pytest.mark.parametrize("wrong", [{}, {"site": 1}, {"units": 1}, {"pages": 4}, {"cells": 1}])
def test_all_of_it_runs_and_each_phase_can_fail(wrong, phases, capsys):
    ran = phases(**wrong)
    assert testing.main(["--all"]) == bool(wrong)
    assert ran[:2] == [["extras"], ["ptae_lite.book.site"]] and len(ran) == 5
    assert [mark_of(one) for one in ran[2:4]] == ["not browser", "browser"]  # all there are
    last = capsys.readouterr().out.splitlines()[-1]
    assert ("FAILED" in last) == bool(wrong) and "Left out" not in last
    assert ("logs" in last) == ("pages" in wrong)


def test_the_markers_are_those_of_the_project():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))
    markers = [line.split(":")[0] for line in project["tool"]["pytest"]["ini_options"]["markers"]]
    assert markers == list(testing.NOT_QUICK)
    assert set(testing.EXTRAS) < set(project["project"]["optional-dependencies"])


def test_extras_are_installed_once_and_change_nothing_pinned(root, monkeypatch, capsys):
    ran = []
    text = '[project.optional-dependencies]\nbert = ["a==1"]\ncluster = ["b==2"]\ncourse = []\n'
    (root / "pyproject.toml").write_text(text)
    monkeypatch.setattr(testing, "call", lambda *_, **__: 1)
    testing.ensure_extras(root)
    assert "build/logs/extras.log" in capsys.readouterr().out
    monkeypatch.setattr(testing, "call", lambda *words, **_: ran.append(list(words)) or 0)
    for _ in range(2):
        testing.ensure_extras(root)
    (command,) = ran
    assert command[-4:] == ["-c", "environment.txt", "a==1", "b==2"]
    (root / "environment.txt").write_text("numpy==2.0\n")
    testing.ensure_extras(root)
    assert len(ran) == 2


@pytest.mark.parametrize("status", [0, 5])
def test_with_arguments_only_those_tests_run(status, monkeypatch):
    ran = []
    monkeypatch.setattr(testing, "call", lambda *words: ran.append(words) or status)
    assert testing.main(["--", "-k", "words"]) == bool(status)
    (command,) = ran
    assert command[-2:] == ("-k", "words") and "--nbval-lax" not in command


def test_the_tests_log_what_concerns_no_reader_and_give_pytests_status(monkeypatch, tmp_path):
    monkeypatch.setattr(testing, "ROOT", tmp_path)
    (tmp_path / "ends.py").write_text("import sys; print('noise', file=sys.stderr); sys.exit(3)")
    assert testing.call("ends", log="unit") == 3
    assert (tmp_path / "build" / "logs" / "unit.log").read_text().split() == ["noise"]


@pytest.mark.parametrize("job", ["book", "test"])
def test_the_tier_reaches_what_a_job_starts(job, monkeypatch, phases):
    monkeypatch.setenv("PTAE_TIER", "replay")
    tiers, module = [], importlib.import_module(run.JOBS[job][0])
    phases()
    monkeypatch.setattr(site, "build", lambda *_: tiers.append(os.environ["PTAE_TIER"]))
    monkeypatch.setattr(testing, "run_phases", lambda _: tiers.append(os.environ["PTAE_TIER"]) or 0)
    module.main(["--tier", "quick"])
    assert tiers == ["quick"]


def test_jupyterlab_is_reachable_from_this_machine_only(calls, environment):
    run.main(["lab", "--", "--no-browser"])
    assert "--ip=127.0.0.1" in calls[0] and calls[0][-1] == "--no-browser" and "--" not in calls[0]


@pytest.mark.parametrize("wrong", [["bok"], [], ["--tier", "quick", "book"]])
def test_what_is_no_job_ends_before_anything_is_made(wrong, monkeypatch):
    monkeypatch.setattr(run, "ensure_environment", lambda env: 1 / 0)
    with pytest.raises(SystemExit) as ended:
        run.main(wrong)
    assert ended.value.code == 2


@pytest.mark.parametrize(
    ("job", "wrong"),
    [
        ("test", ["--all", "--", "-k", "x"]),
        ("book", ["--tier", "slow"]),
        ("book", ["--", "-k"]),
        ("full", ["--sedes", "1"]),
        ("certify", ["mine.json"]),
    ],
)
def test_what_a_job_does_not_understand_is_refused(job, wrong, monkeypatch):
    with pytest.raises(SystemExit) as ended:
        importlib.import_module(run.JOBS[job][0]).main(wrong)
    assert ended.value.code == 2


def test_a_child_gets_the_environment_and_gives_its_status():
    code = "import os, sys; sys.exit(int(os.environ['STATUS']))"
    assert run.call([sys.executable, "-c", code], {"STATUS": "3", "SYSTEMROOT": "C:\\Windows"}) == 3


def test_what_goes_to_a_log_is_not_shown_but_a_clock_in_a_terminal(root, monkeypatch, capfd):
    monkeypatch.setattr(run, "ROOT", root)
    code = "import time; print('noise', flush=True); time.sleep(1.2)"
    for terminal in (False, True):
        monkeypatch.setattr(sys.stdout, "isatty", lambda terminal=terminal: terminal)
        with run.log("job") as file:
            run.call([sys.executable, "-c", code], run.os.environ, stdout=file, stderr=file)
        assert (root / "build" / "logs" / "job.log").read_text().split() == ["noise"]
        shown = capfd.readouterr().out
        assert "noise" not in shown and "\n" not in shown and bool(shown) is terminal


def test_the_doctor_is_told_of_the_variables_that_others_are_started_without(monkeypatch):
    seen = []
    monkeypatch.setattr(run, "call", lambda command, env: seen.append(env) or 0)
    monkeypatch.setenv("PYTHONPATH", "elsewhere")
    monkeypatch.setattr(run, "ensure_environment", lambda env: Path(sys.executable))
    run.main(["doctor"])
    run.main(["notebooks"])
    assert seen[0]["PYTHONPATH"] == "elsewhere" and "PYTHONPATH" not in seen[1]


@pytest.mark.slow
@pytest.mark.skipif(os.name == "nt", reason="Windows reports a closed pipe in another way")
@pytest.mark.parametrize(
    "command",
    [["run.py", "doctor"], ["-m", "ptae_lite.reproduce.pipeline", "--plan"]],
    ids=" ".join,
)
def test_a_command_whose_output_nobody_reads_ends_quietly(command):
    """As before `| head -3`, when head has seen enough."""
    reader, writer = os.pipe()
    os.close(reader)
    done = subprocess.run(
        [sys.executable, *command], cwd=ROOT, stdout=writer, stderr=subprocess.PIPE, text=True
    )
    os.close(writer)
    assert done.stderr == "" and done.returncode == run.READER_GONE
