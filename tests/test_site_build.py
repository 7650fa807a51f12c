"""Building the site: whole or as before, its chapters' times, and one build at a time."""

import json
import subprocess

import pytest

from ptae_lite.book import site
from ptae_lite.errors import FileError
from ptae_lite.files import alone


@pytest.fixture
def sphinx(monkeypatch):
    """In place of Sphinx: writes a page and the chapters' times, or stops before its end."""

    def become(status=0, ends=True, times=None):
        def call(command):
            book, html = command[-2:]
            target = site.Path(html)
            target.mkdir(parents=True)
            (target / "index.html").write_text(f"of {book}")
            if ends:
                (target.parent / site.TIMES).write_text(json.dumps(times or {}))
            return status

        monkeypatch.setattr(subprocess, "call", call)

    return become


def test_a_new_site_takes_the_place_of_the_old_one(sphinx, tmp_path, capsys):
    for book in ("first", "second"):
        sphinx(times={"01_new": {"seconds": 2, "traceback": ""}})
        assert site.main(["--out", str(tmp_path), "--book", book]) == 0
        out = capsys.readouterr().out
        assert "01_new  ran in 2.0 s" in out and "Open " in out and "index.html" in out
    assert (tmp_path / "html/index.html").read_text() == "of second"
    assert sorted(path.name for path in tmp_path.iterdir()) == [
        "chapter_times.json", "html", "html.lock"
    ]  # fmt: skip


def test_a_site_with_faults_is_shown_and_fails(sphinx, tmp_path, capsys):
    sphinx(status=2, times={"02_x": {"seconds": 0.5, "traceback": "ValueError: no"}})
    assert site.main(["--out", str(tmp_path)]) == 1
    out = capsys.readouterr().out
    assert "02_x  FAILED after 0.5 s\n    ValueError: no" in out and "has faults" in out
    assert (tmp_path / "html/index.html").exists()


def test_a_build_that_does_not_reach_its_end_leaves_the_old_site(sphinx, tmp_path, capsys):
    sphinx()
    site.main(["--out", str(tmp_path), "--book", "old"])
    sphinx(status=-9, ends=False)
    assert site.main(["--out", str(tmp_path), "--book", "new"]) == 1
    assert "The book was not built" in capsys.readouterr().out
    assert (tmp_path / "html/index.html").read_text() == "of old"
    assert not (tmp_path / site.TIMES).exists()  # the old times are not this run's


def test_two_builds_at_once_are_refused(sphinx, tmp_path):
    sphinx()
    with (
        alone(tmp_path / "html"),
        pytest.raises(FileError, match="another run is at work on .*html; wait until it ends"),
    ):
        site.build(tmp_path)
    assert not (tmp_path / "html").exists()


def test_the_end_of_a_long_traceback_is_shown():
    traceback = "\n".join(f"line {i}" for i in range(100))
    lines = site.chapter_lines(
        {"02_vision": {"seconds": 0.51, "traceback": traceback},
         "01_simulation": {"seconds": 12.34, "traceback": ""}}
    )  # fmt: skip
    assert lines[:2] == ["01_simulation  ran in 12.3 s", "02_vision      FAILED after 0.5 s"]
    assert lines[-1] == "    line 99" and len(lines) == 2 + site.TAIL
    assert site.chapter_lines({}) == []
