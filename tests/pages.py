"""Pages in a real browser: Chromium from the system, driven by Playwright, without a network."""

import io
import shutil
import time
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from ptae_lite.book import chapters

ROOT = Path(__file__).resolve().parents[1]
SITE = ROOT / "build" / "html"
SHOTS = ROOT / "build" / "screenshots"
PART_PX = 4000  # of a screenshot; a browser draws no more than 8192 rows at once
WIDTHS = {"laptop": (1280, 800), "phone": (390, 844)}
NAMES = ("chromium", "chromium-browser", "google-chrome", "chrome")
FLAGS = [
    "--no-sandbox",  # needed by root, as whom builds often run
    "--no-first-run", "--disable-quic", "--disable-sync",
    "--disable-background-networking", "--disable-component-update",
    "--use-angle=swiftshader", "--enable-unsafe-swiftshader",  # WebGL without a graphics card
]  # fmt: skip


def chromium_path():
    return next(filter(None, map(shutil.which, NAMES)), None)


def stale(site: Path = SITE) -> str:
    """Why a built site does not show what the sources say now; nothing if it does."""
    index = site / "index.html"
    if not index.exists():
        return "there is no built site; python3 run.py book makes it"
    book = ROOT / "book"
    sources = [book / "conf.py", *book.glob("_static/*")]
    sources += [book / f"{name}.md" for name in chapters.page_names(book)]
    sources += [path for path in ROOT.glob("src/ptae_lite/**/*") if path.suffix in (".py", ".js")]
    newest = max(sources, key=lambda path: path.stat().st_mtime)
    if newest.stat().st_mtime > index.stat().st_mtime:
        return f"the built site is older than {newest.name}; python3 run.py book renews it"
    return ""


def page_names() -> list:
    """Pages of the built site, for tests that are made for each of them."""
    return sorted(path.relative_to(SITE).as_posix() for path in SITE.rglob("*.html")
                  if "_static" not in path.parts)  # fmt: skip


@contextmanager
def chromium():
    """A running browser; skips where there is none."""
    path = chromium_path()
    if path is None:
        pytest.skip("no Chromium here; on Debian: apt-get install chromium")
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=path, args=FLAGS)
        yield browser
        browser.close()


@contextmanager
def opened(browser, width="laptop"):
    """A page without a network; fails at its end if anything went wrong in it."""
    w, h = WIDTHS[width]
    context = browser.new_context(
        viewport={"width": w, "height": h}, offline=True, color_scheme="light",
        reduced_motion="reduce",
    )  # fmt: skip
    context.set_default_timeout(120_000)  # a busy machine draws slowly
    page, wrong = context.new_page(), []

    def asked(request):
        if not request.url.startswith(("file:", "data:", "blob:", "about:")):
            wrong.append(f"asks for {request.url}")

    def missed(request):
        # one that its own page gave up, as a scene does that is put out of sight, is not missing
        if "ERR_ABORTED" not in (request.failure or ""):
            wrong.append(f"misses {request.url[:200]}")

    def said(message):
        if message.type == "error":
            wrong.append(f"console: {message.text}")

    page.on("request", asked)
    page.on("requestfailed", missed)
    page.on("console", said)
    page.on("pageerror", lambda error: wrong.append(f"error: {error}"))
    try:
        yield page
    finally:
        context.close()
    assert not wrong, "\n".join(wrong)


def go(page, name: str) -> None:
    page.goto((SITE / name).as_uri() if "?" not in name else f"{SITE.as_uri()}/{name}")
    page.wait_for_load_state("load")
    page.evaluate("""document.documentElement.dataset.formulasScript && Promise.race([
        drawFormulas(), new Promise(done => setTimeout(done, 20000))])""")


def until(condition, seconds: float = 20, message: str = "it did not happen") -> None:
    """Wait until something is so: machines differ in how soon they draw."""
    ends = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < ends, message
        time.sleep(0.05)


def pixels(locator) -> np.ndarray:
    """What an element looks like."""
    return np.array(Image.open(io.BytesIO(locator.screenshot())).convert("RGB")).astype(int)


def keep(page, name: str) -> None:
    """A picture of the whole page in build/screenshots, in parts where it is long."""
    SHOTS.mkdir(parents=True, exist_ok=True)
    height = page.evaluate("document.documentElement.scrollHeight")
    width = page.viewport_size["width"]
    for part, top in enumerate(range(0, height, PART_PX)):
        clip = {"x": 0, "y": top, "width": width, "height": min(PART_PX, height - top)}
        path = SHOTS / f"{name}-{part:02}.jpg"
        page.screenshot(path=path, type="jpeg", quality=75, full_page=True, clip=clip)
