"""The arm acts in a page: the policy, the eye and the physics are those of chapter 06."""

import importlib.util
import json
import re
import shutil
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest
from pages import SITE, opened, pixels, stale

from ptae_lite.data.samples import load_samples
from ptae_lite.live import scripts

pytestmark = [
    pytest.mark.browser,
    pytest.mark.skipif(bool(stale()), reason=stale() or "built"),
    pytest.mark.skipif(bool(scripts.missing()), reason="the scripts of package.json are missing"),
]
BENCHMARKS = Path(__file__).parents[1] / "benchmarks"
PAGE = """<!DOCTYPE html><html lang="en"><head><meta charset="utf-8"><title>Act</title>
<link rel="stylesheet" href="_static/book.css"><script src="_static/live/loader.js"></script>
<script src="_static/live/packs.js"></script><script src="again.js"></script></head><body>
<div data-ptae-live="PART" data-offer="Act"><p class="stored">stored</p></div></body></html>
"""
EPISODES = 12  # of each condition, 60 in all
WATCHED = 12  # of a model that looks in each frame
MEMORY_MB = 300
ASKED = """async asked => {
  await Promise.all(PtaeLive.scripts.map(PtaeLive.script));
  return actAgain(asked);
}"""
STARE = """async asked => {
  await Promise.all(PtaeLive.scripts.map(PtaeLive.script));
  const {see} = PtaeLive.Robot.prototype, first = new Map();
  PtaeLive.Robot.prototype.see = function (joints, cubes, colours, eye) {
    if (!first.has(colours)) first.set(colours, see.call(this, joints, cubes, colours, eye));
    return first.get(colours);
  };
  return actAgain(asked);
}"""  # the first picture again and again


def _benchmark(name: str):
    spec = importlib.util.spec_from_file_location(name, BENCHMARKS / f"{name}.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


live_physics, live_memory = map(_benchmark, ("live_physics", "live_memory"))


def act_folder(tmp_path_factory):
    """The part alone, in a folder with a difficult name."""
    place = tmp_path_factory.mktemp("act") / "Hände & Würfel"
    shutil.copytree(SITE / "_static" / "live", place / "_static" / "live")
    for name in ("scene.js", "book.css"):
        shutil.copyfile(SITE / "_static" / name, place / "_static" / name)
    shutil.copyfile(BENCHMARKS / "live_physics.js", place / "again.js")
    for name, part in {"index": "act", "policies": "policies"}.items():
        (place / f"{name}.html").write_text(PAGE.replace("PART", part), "utf-8")
    return place


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return act_folder(tmp_path_factory)


def pressed(page):
    """The part, when it is ready."""
    place = page.locator("[data-ptae-live]")
    place.locator("button").first.click()
    page.locator("[data-ptae-live][data-state]").wait_for()
    assert place.get_attribute("data-state") == "ready", place.inner_text()
    return place


def act(place, sentence: str, button: str = "Act") -> dict:
    """Type a sentence and press the button; what the part says when the arm has acted."""
    room = "document.querySelector('[data-ptae-live] > div').dataset"
    before = place.page.evaluate(f"Number({room}.answered ?? 0)")
    place.get_by_label("sentence").fill(sentence)
    place.get_by_role("button", name=button, exact=True).click()
    place.page.wait_for_function(f"before => Number({room}.answered ?? 0) > before", arg=before)
    said = place.locator(".ptae-live-said")
    return {"text": said.inner_text()} | said.evaluate("one => ({...one.dataset})")


def test_verdicts_are_pybullets(page, simulator):
    samples = load_samples("recording")
    asked = []
    for condition in live_physics.CONDITIONS:
        of = live_physics.tasks(samples, condition)
        asked += of[:: len(of) // EPISODES][:EPISODES]
    seen = live_physics.random_tasks(WATCHED, "ptae")
    made = page.evaluate(ASKED, json.loads(json.dumps(asked + seen)))
    table = live_physics.compared(asked + seen, made)
    print(live_physics.summary(table).round(2).to_string())
    seen, table = table[len(asked) :], table[: len(asked)]
    assert (seen["success"] == seen["success_stored"]).mean() >= 0.9
    assert seen["ms"].median() < 5000
    assert (table["success"] == table["success_stored"]).mean() >= 0.98
    assert (table["named_mm"] - table["named_mm_stored"]).abs().median() < 1
    assert table["ms"].median() < 2000


def moved_scenes():
    """Scenes in which PyBullet moved cubes, evenly chosen."""
    asked = live_physics.tasks(load_samples("recording"), "moved", live_physics.WATCHING)
    return json.loads(json.dumps(asked[:: len(asked) // WATCHED][:WATCHED]))


def test_it_follows_a_cube_that_is_moved_as_in_pybullet(page):
    made = page.evaluate(ASKED, moved_scenes())
    table = live_physics.compared(moved_scenes(), made)
    print(live_physics.summary(table).round(2).to_string())
    assert (table["success"] == table["success_stored"]).mean() >= 0.9
    assert (table["named_mm"] - table["named_mm_stored"]).abs().median() < 2
    assert table["ms"].median() < 5000 and min(one["event"] for one in made) > 0


def test_a_page_that_shows_it_the_first_picture_only_is_seen(page):
    made = page.evaluate(STARE, moved_scenes())
    assert np.mean([one["success"] for one in made]) < 0.5


def test_a_sentence_is_acted_told_and_described(page):
    place = pressed(page)
    assert place.locator(".stored").count() == 0
    done = act(place, "push red slowly")
    assert done["success"] == "true" and "mm away from the robot" in done["text"]
    assert done["described"].split()[0] in ("push", "move-up")
    frame = place.locator("iframe").content_frame
    frame.locator("#play:enabled").wait_for()
    assert "frame" in frame.locator("#clock").inner_text()


def test_words_and_colours_that_are_not_there(page):
    place = pressed(page)
    place.get_by_label("sentence").fill("walk red slowly")
    place.get_by_role("button", name="Act", exact=True).click()
    alert = place.get_by_role("alert")
    assert "walk" in alert.inner_text() and "push" in alert.inner_text()
    done = act(place, "push yellow slowly")
    assert done["success"] == "false" and "no yellow cube" in done["text"]


def test_moved_cubes_are_seen_and_must_not_overlap(page):
    place = pressed(page)
    eye = place.locator("canvas.ptae-live-eye")
    before = pixels(eye)
    place.locator("summary").click()
    sliders = place.locator("input[type=range]")
    sliders.first.focus()
    for _ in range(3):
        page.keyboard.press("PageUp")
    assert np.abs(pixels(eye).astype(int) - before).max() > 50
    for cube in (0, 2):
        for i, value in enumerate((400, 50)):
            sliders.nth(cube + i).fill(str(value))
    place.get_by_role("button", name="Act", exact=True).click()
    assert "one place" in place.get_by_role("alert").inner_text()


def test_the_reader_chooses_who_acts_and_moves_a_cube_meanwhile(browser, folder):
    with opened(browser) as page:
        page.goto((folder / "policies.html").as_uri())
        place = pressed(page)
        who = place.get_by_label("who acts")
        assert who.locator("option").count() == 3
        assert "a new picture in each frame" in place.inner_text()
        place.locator("summary").click()
        place.get_by_label("a hand moves").select_option(label="the right cube")
        moved = act(place, "push red slowly")
        assert "In frame 15 a hand moved the right cube by 30 mm; that is" in moved["text"]
        who.select_option(label="PTAE of chapter 03")
        place.get_by_label("before frame").fill("100")
        assert "too late" in act(place, "push red fast")["text"]
        who.select_option(label="the one-look policy")
        place.get_by_text("this one picture").wait_for()


def test_the_named_cube_is_snatched_away(browser, folder):
    with opened(browser) as page:
        page.add_init_script("let n = 0; Math.random = () => (n += 0.382) % 1;")
        page.goto((folder / "policies.html").as_uri())
        place = pressed(page)
        told = act(place, "slide red slowly", "Act, and snatch the cube away")
        far_mm = int(re.search(r"moved the (?:left|right) cube by (\d+) mm", told["text"])[1])
        assert 20 <= far_mm <= 40 and told["success"] == "true"
        assert "describes what it saw itself do" in told["text"]
        assert len(told["described"].split()) == 3
        place.get_by_label("sentence").fill("slide yellow slowly")
        place.get_by_role("button", name="snatch").click()
        assert "no yellow cube" in place.get_by_role("alert").inner_text()


def test_without_webgl_the_eye_shows_what_happens(browser, folder):
    with opened(browser) as page:
        page.add_init_script("""const real = HTMLCanvasElement.prototype.getContext;
          HTMLCanvasElement.prototype.getContext = function (kind, ...rest) {
            return kind.startsWith("webgl") ? null : real.call(this, kind, ...rest);
          };""")
        page.goto((folder / "index.html").as_uri())
        place = pressed(page)
        act(place, "push red slowly")
        film = place.locator(".ptae-live-film")
        before = pixels(film.locator("canvas"))
        film.locator("input[type=range]").fill("60")
        assert np.abs(pixels(film.locator("canvas")).astype(int) - before).max() > 50


def test_it_fits_a_phone(browser, folder):
    with opened(browser, "phone") as page:
        page.goto((folder / "index.html").as_uri())
        place = pressed(page)
        act(place, "slide red fast")
        wide = page.evaluate("[document.documentElement.scrollWidth, innerWidth]")
        assert wide[0] <= wide[1]


@pytest.mark.skipif(not Path("/proc/self/smaps_rollup").exists(), reason="Linux tells the memory")
def test_it_never_takes_too_much_memory():
    """Also while it loads, and while browsers make its code fast."""
    with ThreadPoolExecutor(1) as pool:  # its Playwright cannot share a thread with the tests'
        measured = pool.submit(live_memory.measured, (SITE / "index.html").as_uri())
    peaks = measured.result().peaks()
    print(peaks)
    assert 20 < peaks["page"] < peaks["acting"] and max(peaks.values()) < MEMORY_MB
