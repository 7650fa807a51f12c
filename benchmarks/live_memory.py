"""How much memory the front page takes while its models load and act, in Chromium.

    python benchmarks/live_memory.py [PAGE] [--runs N] [--curve]

PAGE is a page with the acting part (default: build/html/index.html). What is measured is the
memory that the page's process has for itself, without what it shares with others. It is read 20
times a second, so shorter peaks may be missed. Linux only.
"""

from __future__ import annotations

import argparse
import shutil
import statistics
import sys
import threading
import time
from pathlib import Path

import psutil

ROOT = Path(__file__).resolve().parents[1]
BROWSERS = ("chromium", "chromium-browser", "google-chrome", "chrome")
FLAGS = ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
EVERY_S = 0.05
SENTENCES = ("push {} slowly", "slide {} fast")
PHASES = {  # what happens in each, until its end
    "page": "before the button is pressed",
    "loading": "until the part is ready",
    "after": "the next 5 s",
    "acting": "two sentences, acted and described",
    "rest": "3 s later",
}


class Watch(threading.Thread):
    """Reads the memory of the browser's pages again and again."""

    def __init__(self):
        super().__init__(daemon=True)
        self.phase, self.read, self.ended = "page", [], threading.Event()

    def run(self) -> None:
        while not self.ended.wait(EVERY_S):
            self.read.append((self.phase, time.monotonic(), own_mb()))

    def peaks(self) -> dict[str, float]:
        """The largest number of each phase; of the last one, the last."""
        found = {name: [mb for phase, _, mb in self.read if phase == name] for name in PHASES}
        return {name: every[-1] if name == "rest" else max(every) for name, every in found.items()}


def own_mb() -> float:
    """The private memory of the largest page of this process' browser."""
    sizes = [0.0]
    for one in psutil.Process().children(recursive=True):
        try:
            if "--type=renderer" in one.cmdline():
                sizes.append(private_mb(one.pid))
        except (psutil.Error, OSError):  # it has just ended
            continue
    return max(sizes)


def private_mb(pid: int) -> float:
    text = Path(f"/proc/{pid}/smaps_rollup").read_text()
    lines = (line.split() for line in text.splitlines() if line.startswith("Private_"))
    return sum(int(kilobytes) for _, kilobytes, _ in lines) * 1024 / 1e6


def measured(address: str) -> Watch:
    """Open the page in a new browser, press the button, and act twice."""
    from playwright.sync_api import sync_playwright

    program = next(filter(None, map(shutil.which, BROWSERS)))
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=program, args=FLAGS)
        page = browser.new_page()
        page.set_default_timeout(120_000)
        watch = Watch()
        watch.start()
        page.goto(address)
        page.wait_for_timeout(2000)
        watch.phase = "loading"
        place = page.locator("[data-ptae-live]").first
        place.locator("button").first.click()
        page.locator("[data-ptae-live][data-state=ready]").wait_for()
        watch.phase = "after"
        page.wait_for_timeout(5000)
        watch.phase = "acting"
        sentence = place.get_by_label("sentence")
        colour = sentence.input_value().split()[1]
        for number, text in enumerate(SENTENCES, 1):
            sentence.fill(text.format(colour))
            place.get_by_role("button", name="Act", exact=True).click()
            place.locator(f"[data-answered='{number}']").wait_for()
            page.wait_for_timeout(1500)
        watch.phase = "rest"
        page.wait_for_timeout(3000)
        watch.ended.set()
        watch.join()
        browser.close()
    return watch


def main(arguments=None) -> int:
    """Measure, and print the peak of each phase; returns the exit code."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("page", type=Path, nargs="?", default=ROOT / "build/html/index.html")
    parser.add_argument("--runs", type=int, default=1, help="browsers, one after another")
    parser.add_argument("--curve", action="store_true", help="every number of the last run")
    given = parser.parse_args(arguments)
    watches = [measured(given.page.resolve().as_uri()) for _ in range(given.runs)]
    for name, says in PHASES.items():
        every = [watch.peaks()[name] for watch in watches]
        kind = "at its end" if name == "rest" else "peak"
        print(f"{name:8} {says:36} {kind:10} {statistics.median(every):4.0f} MB"
              f"  ({', '.join(f'{one:.0f}' for one in every)})")  # fmt: skip
    if given.curve:
        begun = watches[-1].read[0][1]
        for phase, at, mb in watches[-1].read:
            print(f"{at - begun:6.2f} s  {phase:8} {mb:4.0f} MB")
    return 0


if __name__ == "__main__":
    sys.exit(main())
