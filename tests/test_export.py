"""A notebook that `jupyter nbconvert` runs and turns into a page: its panels work by themselves."""

import subprocess
import sys

import nbformat
import pytest
from nbformat.v4 import new_code_cell, new_notebook
from pages import chromium, until

CELLS = (
    "from ptae_lite.plots import style\n"
    "from ptae_lite.widgets.panels import Panel\n"
    "import matplotlib.pyplot as plt\n"
    "style.use()",
    "def line(slope):\n"
    "    figure, axes = plt.subplots()\n"
    "    axes.plot([0, slope])\n"
    "    return figure\n"
    "Panel(line, [1, 2, 3], 'slope')",
)


@pytest.mark.browser
def test_a_panel_of_an_exported_notebook_moves_without_a_network(tmp_path, monkeypatch):
    monkeypatch.delenv("PTAE_STATIC", raising=False)
    notebook = new_notebook(cells=list(map(new_code_cell, CELLS)))
    notebook.metadata["kernelspec"] = {"name": "python3", "display_name": "Python 3"}
    nbformat.write(notebook, tmp_path / "x.ipynb")
    command = [sys.executable, "-m", "jupyter", "nbconvert", "--execute", "--to", "html", "x.ipynb"]
    run = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True)
    assert run.returncode == 0, run.stderr
    with chromium() as browser:
        page = browser.new_context(offline=True).new_page()
        page.goto((tmp_path / "x.html").as_uri(), wait_until="domcontentloaded")
        slider = page.locator('[data-ptae-embed="panel"] input[type=range]')
        shown = page.locator("[data-frame]:not([hidden]) img")
        assert shown.get_attribute("alt") == "slope = 1"
        slider.focus()
        slider.press("ArrowRight")
        assert shown.get_attribute("alt") == "slope = 2"
        # a page that has its document may still load its pictures
        until(lambda: shown.evaluate("image => image.complete && image.naturalWidth > 100"))
