"""Building the site: whole or as before, what a reader sees of it, and one build at a time."""

import json
import sys

import pytest

from ptae_lite.book import site
from ptae_lite.errors import FileError
from ptae_lite.files import file_lock


@pytest.fixture
def sphinx(monkeypatch):
    """In place of Sphinx: writes a page and the chapters' times, or stops before its end."""

    def become(status=0, ends=True, times=None):
        def run(command, log, ended, show):
            book, html = command[-2:]
            target = site.Path(html)
            target.mkdir(parents=True)
            (target / "index.html").write_text(f"of {site.Path(book).name}")
            for name, chapter in (times or {}).items():
                show(name, chapter)
            if ends:
                (target.parent / site.TIMES).write_text(json.dumps(times or {}))
            return status

        monkeypatch.setattr(site, "run", run)

    return become


def test_a_new_site_takes_the_place_of_the_old_one(sphinx, tmp_path, capsys):
    for book in ("first", "second"):
        sphinx(times={"01_new": {"seconds": 2, "traceback": ""}})
        assert site.main(["--out", str(tmp_path), "--book", book]) == 0
        *_, chapter, where = capsys.readouterr().out.splitlines()
        assert chapter.split() == ["01_new", "ran", "in", "2.0", "s"] and "index.html" in where
    assert (tmp_path / "html/index.html").read_text() == "of second"
    assert sorted(path.name for path in tmp_path.iterdir()) == [
        "chapter_times.json", "html", "html.lock"
    ]  # fmt: skip


def test_a_site_with_faults_is_shown_and_fails(sphinx, tmp_path, capsys):
    sphinx(status=2, times={"02_x": {"seconds": 0.5, "traceback": "ValueError: no"}})
    assert site.main(["--out", str(tmp_path)]) == 1
    out = capsys.readouterr().out
    assert "FAILED after 0.5 s\n    ValueError: no\n" in out
    assert out.splitlines()[-1].count(str(tmp_path / "logs" / "sphinx.log")) == 1
    assert (tmp_path / "html/index.html").exists()


def test_a_build_that_does_not_reach_its_end_leaves_the_old_site(sphinx, tmp_path, capsys):
    sphinx()
    site.main(["--out", str(tmp_path), "--book", "old"])
    sphinx(status=-9, ends=False)
    assert site.main(["--out", str(tmp_path), "--book", "new"]) == 1
    assert str(tmp_path / "logs" / "sphinx.log") in capsys.readouterr().out
    assert (tmp_path / "html/index.html").read_text() == "of old"
    assert not (tmp_path / site.TIMES).exists()  # the old times are not this run's


@pytest.mark.parametrize(("said", "killed"), [("DeadKernelError: Kernel died", True), ("x", False)])
def test_a_killed_kernel_is_told_as_such(said, killed, sphinx, tmp_path, capsys):
    sphinx(status=2, ends=False)
    (tmp_path / "logs").mkdir()
    (tmp_path / site.LOG).write_text(f"Extension error:\n{said}\n")
    assert site.main(["--out", str(tmp_path)]) == 1
    assert ("lack of memory" in capsys.readouterr().out) == killed


def test_two_builds_at_once_are_refused(sphinx, tmp_path):
    sphinx()
    with (
        file_lock(tmp_path / "html"),
        pytest.raises(FileError, match="another run is at work on .*html; wait until it ends"),
    ):
        site.build(tmp_path)
    assert not (tmp_path / "html").exists()


def test_the_end_of_a_long_traceback_is_shown():
    traceback = "\n".join(f"line {i}" for i in range(100))
    lines = site.chapter_lines("02_vision", {"seconds": 0.51, "traceback": traceback})
    assert lines[0].split() == ["02_vision", "FAILED", "after", "0.5", "s"]
    assert lines[-1] == "    line 99" and len(lines) == 1 + site.TAIL


CHILD = """
import sys, time
print("noise")
print("warning", file=sys.stderr)
path, go_on = sys.argv[1:]
with open(path, "a") as file:
    for part in ('["01_a", {}]\\n["02', '_b", {}]\\n'):
        file.write(part)
        file.flush()
        while part.startswith("[") and not __import__("os").path.exists(go_on):
            time.sleep(0.01)
sys.exit(3)
"""


@pytest.mark.parametrize("terminal", [False, True])
def test_a_chapter_is_shown_when_it_ends_and_noise_goes_to_the_log(
    terminal, tmp_path, monkeypatch, capsys
):
    """The child ends only after its first chapter was shown, with half a line of the next there."""
    shown, go_on = [], tmp_path / "go on"
    monkeypatch.setattr(site, "POLL_S", 0.01)
    monkeypatch.setattr(sys.stdout, "isatty", lambda: terminal)

    def show(name, chapter):
        shown.append(name)
        go_on.touch()

    ended, log = tmp_path / "ended", tmp_path / "logs" / "sphinx.log"
    command = [sys.executable, "-c", CHILD, str(ended), str(go_on)]
    assert site.run(command, log, ended, show) == 3
    assert shown == ["01_a", "02_b"]
    assert {"noise", "warning"} <= set(log.read_text().split())
    captured = capsys.readouterr()
    assert captured.err == "" and ("\r" in captured.out) is terminal
    assert "\n" not in captured.out and not captured.out.strip() or terminal
