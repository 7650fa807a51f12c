"""Chapters in JupyterLab, as a reader works in them: run, move the sliders, edit, save.

Two chapters; `--lab=all` (after `python3 run.py test --`) takes all of them.
"""

import os
import re
import shutil
import signal
import socket
import subprocess
import sys
import time
import urllib.request

import pytest
from pages import ROOT, SHOTS, until

from ptae_lite.book.chapters import notebook_files

pytestmark = pytest.mark.browser
TOKEN = "reader"
SETTINGS = "@jupyterlab/apputils-extension/notification.jupyterlab-settings"
RUN_S = 480  # for a chapter


def pytest_generate_tests(metafunc):
    if "chapter" in metafunc.fixturenames:
        book = ROOT / "book"
        names = [md.relative_to(book).with_suffix("").as_posix() for md in notebook_files(book)]
        if metafunc.config.getoption("--lab") != "all":
            names = [name for name in names if name[:2] in ("01", "05")]
        metafunc.parametrize("chapter", names)


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


@pytest.fixture(scope="module")
def lab(tmp_path_factory, browser):
    """JupyterLab on a copy of the book, with settings of its own; its address and its folder."""
    home = tmp_path_factory.mktemp("lab")
    shutil.copytree(ROOT / "book", home / "book")
    folders = {
        name: str(home / name.lower())
        for name in (
            "JUPYTER_CONFIG_DIR", "JUPYTER_DATA_DIR", "JUPYTER_RUNTIME_DIR", "IPYTHONDIR",
            "JUPYTERLAB_SETTINGS_DIR", "JUPYTERLAB_WORKSPACES_DIR",
        )
    }  # fmt: skip
    settings = home / "jupyterlab_settings_dir" / SETTINGS
    settings.parent.mkdir(parents=True)
    settings.write_text('{"fetchNews": "false", "checkForUpdates": false}')  # ask nobody outside
    port = free_port()
    command = [
        sys.executable, "-m", "jupyter", "lab", "--no-browser", "--allow-root", "--ip=127.0.0.1",
        f"--port={port}", "--ServerApp.port_retries=0", f"--IdentityProvider.token={TOKEN}",
        f"--ServerApp.root_dir={home}", "--LabApp.expose_app_in_browser=True",
    ]  # fmt: skip
    env = {k: v for k, v in os.environ.items() if k != "PTAE_STATIC"} | folders
    with open(home / "server.log", "w") as log:
        server = subprocess.Popen(
            command, cwd=home, env=env, stdout=log, stderr=log, start_new_session=True
        )
        try:
            address = f"http://127.0.0.1:{port}"
            wait_for(address, server, home / "server.log")
            yield address, home
        finally:
            os.killpg(server.pid, signal.SIGTERM)
            server.wait(30)


def wait_for(address, server, log):
    for _ in range(240):
        assert server.poll() is None, log.read_text()[-2000:]
        try:
            urllib.request.urlopen(f"{address}/api?token={TOKEN}", timeout=1)
            return
        except OSError:
            time.sleep(0.5)
    raise AssertionError("JupyterLab did not start: " + log.read_text()[-2000:])


@pytest.fixture
def notebook(browser, lab, chapter):
    """The chapter opened with its kernel at rest; nothing outside this machine is asked."""
    address, _ = lab
    context = browser.new_context(viewport={"width": 1400, "height": 900})
    page, wrong = context.new_page(), []
    inside = (address, address.replace("http", "ws"), "data:", "blob:", "about:")

    def asked(request):
        if not request.url.startswith(inside):
            wrong.append(f"asks for {request.url}")

    page.on("request", asked)
    page.on("pageerror", lambda error: wrong.append(f"error: {error}"))
    page.goto(f"{address}/lab/tree/book/{chapter}.ipynb?token={TOKEN}&reset")
    page.locator(".jp-Notebook").wait_for(timeout=90_000)
    idle(page, 90)  # running cells before would ask for a kernel and wait for an answer
    yield page
    context.close()
    assert wrong == []


def idle(page, seconds):
    page.get_by_text(re.compile(r"Python 3.*\| Idle")).first.wait_for(timeout=1000 * seconds)


def run_all(page):
    page.get_by_role("menuitem", name="Run", exact=True).click()
    page.get_by_text("Run All Cells", exact=True).first.click()
    begun = time.monotonic()
    while time.monotonic() - begun < RUN_S:
        time.sleep(1)
        if page.evaluate(STILL_TO_RUN) == 0 and begun + 3 < time.monotonic():
            return
    raise AssertionError("the chapter did not come to its end")


# Cells not in the view are not in the page, so the notebook's own model is asked.
STILL_TO_RUN = """() => {
  const cells = window.jupyterapp.shell.currentWidget.content.model.cells;
  let left = 0;
  for (const cell of cells)
    if (cell.type === 'code' && cell.sharedModel.source.trim() && !cell.executionCount) left += 1;
  return left;
}"""
FAILED = """() => {
  const failed = [];
  for (const cell of window.jupyterapp.shell.currentWidget.content.model.cells)
    if (cell.type === 'code')
      for (const output of cell.outputs.toJSON())
        if (output.output_type === 'error') failed.push(output.ename + ': ' + output.evalue);
  return failed;
}"""
# Which cells have put out a panel, or a scene.
PLACES = """([kind, mark]) => {
  const places = [];
  window.jupyterapp.shell.currentWidget.content.widgets.forEach((cell, i) => {
    if (cell.model.type !== 'code') return;
    for (const output of cell.model.outputs.toJSON())
      if ([output.data?.[kind] ?? []].flat().length &&
          JSON.stringify(output.data[kind]).includes(mark)) places.push(i);
  });
  return places;
}"""
PANELS = ["application/vnd.jupyter.widget-view+json", "model_id"]
SCENES = ["text/html", "<iframe"]
GUESSES = ["text/html", "radiogroup"]
SCROLL_TO = """async i => {
  const notebook = window.jupyterapp.shell.currentWidget.content;
  await notebook.scrollToItem(i, 'start');
  notebook.activeCellIndex = i;
}"""


def move_everything(page, cell):
    """Move each control of the panel in a cell, and see that what it shows becomes another."""
    view = cell.locator(".widget-vbox").first
    if view.locator("input[type=text]").count():
        return tell(page, cell)
    shown = view.locator(".widget-html-content")
    shown.first.wait_for(timeout=20_000)
    controls = view.locator(".noUi-handle, select")
    assert controls.count()
    if shown.first.locator("iframe").count():
        play(page, shown.first)
    for i in range(controls.count()):
        control, before = controls.nth(i), shown.first.inner_html()
        if control.evaluate("one => one.tagName") == "SELECT":
            values = control.locator("option").all_text_contents()
            if len(values) == 1:
                continue  # what is shown now leaves no choice here
            now = control.evaluate("one => one.selectedOptions[0].textContent")
            control.select_option(label=next(value for value in values if value != now))
        else:
            control.focus()
            end = control.get_attribute("aria-valuenow") == control.get_attribute("aria-valuemax")
            is_told(control)
            control.press("ArrowLeft" if end else "ArrowRight")
            is_told(control)
        until(lambda before=before: shown.first.inner_html() != before,
              message=f"control {i} was moved, and the panel shows the same")  # fmt: skip
        assert "Traceback" not in shown.first.inner_text()
        pictures = shown.first.locator("img, iframe")
        assert pictures.count() or shown.first.locator("table").count()
        for what in pictures.all():
            assert what.get_attribute("alt") or what.get_attribute("title")


def is_told(handle):
    """A screen reader hears of a slider what is written beside it."""
    slider = handle.locator("xpath=ancestor::*[contains(@class, 'widget-slider')]")
    name = slider.locator(".widget-label").inner_text()
    value = slider.locator(".widget-readout").inner_text()
    assert name and value
    until(lambda: handle.get_attribute("aria-label") == name, message="the slider has no name")
    until(lambda: handle.get_attribute("aria-valuetext") == value, message=f"it says not {value}")


def play(page, cell):
    """Play the scene of a cell, and see that it moves."""
    scene = cell.locator("iframe").first.content_frame
    scene.locator("#clock").filter(has_text="frame").wait_for(timeout=60_000)
    button = scene.locator("#play")

    def plays():
        if button.inner_text() == "Play":  # again, where the page took the scene away and back
            button.click()
        return int(scene.locator("#frame").input_value()) > 0

    until(plays, message="it does not play")
    button.click()


def answer(page, cell):
    """Make a guess by the keyboard, and read the reply; the code that asks is folded."""
    reply = cell.locator("[data-reply-here]")
    assert reply.inner_text() == "" and not cell.locator(".jp-Editor").is_visible()
    cell.get_by_role("radio").first.focus()
    page.keyboard.press("Space")
    until(lambda: reply.inner_text().startswith(("Yes.", "No.")), message="there is no reply")


def tell(page, cell):
    """Type into the box of a cell what is no sentence, and one that is acted out."""
    text, button = cell.locator("input[type=text]"), cell.get_by_role("button", name="Act")
    text.fill("push")
    button.click()
    cell.get_by_role("alert").filter(has_text="three words").wait_for(timeout=20_000)
    text.fill("push scarlet slowly")
    button.click()
    cell.get_by_text("slowly asked for").wait_for(timeout=60_000)
    play(page, cell)


def test_a_chapter_is_run_moved_edited_and_saved(notebook, lab, chapter):
    page, (_, home) = notebook, lab
    run_all(page)
    assert page.evaluate(FAILED) == []
    panels, scenes = page.evaluate(PLACES, PANELS), page.evaluate(PLACES, SCENES)
    assert panels or chapter[:2] not in ("01", "04", "05")
    assert scenes or chapter[:2] != "01"
    guesses = page.evaluate(PLACES, GUESSES)
    assert guesses or chapter[:2] != "01"
    for places, use in ((panels, move_everything), (scenes, play), (guesses, answer)):
        for place in places:
            page.evaluate(SCROLL_TO, place)
            use(page, page.locator(f'.jp-Cell[data-windowed-list-index="{place}"]'))
            SHOTS.mkdir(parents=True, exist_ok=True)
            page.screenshot(path=SHOTS / f"lab-{chapter.replace('/', '-')}-{place}.png")
    source = home / "book" / f"{chapter}.md"
    twin, before = source.with_suffix(".ipynb"), source.read_bytes()
    written = twin.stat().st_mtime_ns
    page.evaluate("() => window.jupyterapp.commands.execute('docmanager:save')")
    until(lambda: twin.stat().st_mtime_ns > written, message=f"{twin.name} was not saved")
    until(lambda: source.stat().st_mtime_ns >= twin.stat().st_mtime_ns, message="not the source")
    assert source.read_bytes() == before  # only run: nothing that is written changed
    page.evaluate(SCROLL_TO, 0)
    cell = page.locator('.jp-Cell[data-windowed-list-index="0"]')
    cell.dblclick()
    editor = cell.locator(".cm-content")
    editor.click()
    page.keyboard.press("Control+End")
    page.keyboard.type("\n\nA reader was here.")
    page.keyboard.press("Shift+Enter")
    page.keyboard.press("Control+s")
    until(lambda: "A reader was here." in source.read_text(encoding="utf-8"),
          message=f"{source.name} does not hold the edit")  # fmt: skip
    assert "A reader was here." in twin.read_text(encoding="utf-8")
