"""One line of progress, and what it leaves behind."""

import sys

import nbformat
import pytest
from nbclient import NotebookClient
from nbformat.v4 import new_code_cell, new_notebook

from ptae_lite.widgets import progress


@pytest.fixture
def lines(monkeypatch):
    """Every state that was shown."""
    shown = []

    class Handle:
        def update(self, line):
            shown.append(line)

    def display(line, display_id):
        assert display_id is True
        shown.append(line)
        return Handle()

    monkeypatch.setattr(progress, "display", display)
    return shown


def test_the_items_come_through_and_the_last_state_is_clean(lines):
    assert list(progress.line([4, 5, 6], "reading")) == [4, 5, 6]
    assert repr(lines[0]) == "reading: 0 of 3" and "<progress" in lines[0].data
    assert repr(lines[-1]) == "reading: 3 of 3 done" and "<progress" not in lines[-1].data


def test_each_item_is_counted_when_it_is_done(lines, monkeypatch):
    monkeypatch.setattr(progress, "EVERY_S", -1)
    list(progress.line(range(2), "a <b>"))
    assert [repr(one) for one in lines[:3]] == [f"a <b>: {n} of 2" for n in range(3)]
    assert "<b>" not in lines[0].data and 'value="1" max="2"' in lines[1].data


def test_renewing_is_rare(lines):
    list(progress.line(range(10_000)))
    assert len(lines) < 10


def test_work_that_breaks_off_says_so(lines):
    def work():
        for item in progress.line([1, 2, 3]):
            if item == 2:
                raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        work()
    assert repr(lines[-1]) == "training: 1 of 3 - stopped"


def test_without_a_length_it_counts(lines):
    list(progress.line(iter("abc"), "frames"))
    assert repr(lines[-1]) == "frames: 3 done"


def test_outside_a_notebook_the_work_goes_on(capsys):
    assert list(progress.line([1, 2])) == [1, 2]


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:Proactor event loop:RuntimeWarning")  # on Windows
@pytest.mark.skipif(sys.platform == "win32", reason="kernels start slowly there")
def test_a_notebook_keeps_one_output_with_the_last_state():
    code = (
        "import time\nfrom ptae_lite.widgets import progress\n"
        "for _ in progress.line(range(4)): time.sleep(0.15)"
    )
    notebook = new_notebook(cells=[new_code_cell(code)])
    NotebookClient(notebook, kernel_name="python3").execute()
    nbformat.validate(notebook)
    (output,) = [one for one in notebook.cells[0].outputs if one.output_type == "display_data"]
    assert output.data["text/html"] == "<span>training: 4 of 4 done</span>"
    assert output.data["text/plain"] == "training: 4 of 4 done"
