"""The built site in Chromium, offline and from its folder: pages, scenes, panels, print, search."""

import json
import shutil
from itertools import product
from pathlib import Path
from urllib.parse import urlsplit
from urllib.request import url2pathname

import numpy as np
import pytest
from pages import (
    SHOTS,
    SITE,
    WIDTHS,
    chromium,
    go,
    keep,
    opened,
    page_names,
    pixels,
    stale,
    until,
)  # fmt: skip

from ptae_lite.data.samples import load_samples
from ptae_lite.widgets import scene3d, viewer

pytestmark = pytest.mark.browser
PAGES = page_names()
SCENE = 'iframe[data-ptae-embed="scene"]'
PANEL = '[data-ptae-embed="panel"]'
PAGE_BYTES = 1_500_000


@pytest.fixture(scope="module")
def browser():
    reason = stale()
    if reason:
        pytest.skip(reason)
    with chromium() as running:
        yield running


def with_embeds(selector):
    """Pages that have scenes or panels, by their source."""
    mark = {SCENE: 'data-ptae-embed="scene"', PANEL: 'data-ptae-embed="panel"'}[selector]
    return [name for name in PAGES if mark in (SITE / name).read_text(encoding="utf-8")]


def scroll_through(page):
    """Let everything that waits until it is seen load."""
    page.evaluate("""async () => {
      for (let y = 0; y < document.documentElement.scrollHeight; y += 600) {
        window.scrollTo(0, y);
        await new Promise(done => setTimeout(done, 30));
      }
      window.scrollTo(0, 0);
      for (const image of document.images) image.loading = "eager";  // it scrolls past too fast
      await Promise.allSettled([...document.images].map(image => image.decode()));
    }""")


@pytest.mark.parametrize("width", WIDTHS)
@pytest.mark.parametrize("name", PAGES)
def test_a_page_opens_without_a_network_and_fits_its_width(browser, name, width, request):
    with opened(browser, width) as page:
        go(page, name)
        scroll_through(page)
        for iframe in page.locator(f"{SCENE}:visible").all():
            ready(iframe)
        page.evaluate("window.scrollTo(0, 0)")
        assert page.evaluate(BROKEN_PICTURES) == []
        too_wide = page.evaluate("document.documentElement.scrollWidth - innerWidth")
        assert too_wide <= 0, page.evaluate(WIDE)
        for theme in ("light", "dark"):
            page.emulate_media(color_scheme=theme)  # as when the reader's system changes
            until(
                lambda theme=theme: page.evaluate("document.documentElement.dataset.theme") == theme
            )
            # A long page takes many seconds to draw.
            if request.config.getoption("screenshots") and SHOWN[width] == theme:
                keep(page, f"{name.removesuffix('.html').replace('/', '-')}-{width}-{theme}")


SHOWN = {"laptop": "light", "phone": "dark"}
BROKEN_PICTURES = """[...document.images]
  .filter(one => one.checkVisibility() && !(one.complete && one.naturalWidth))
  .map(one => one.src.slice(0, 100))"""
WIDE = """[...document.querySelectorAll('main *')]
  .filter(one => one.getBoundingClientRect().right > innerWidth + 1 && one.checkVisibility() &&
    !one.closest('.cell_output, pre, table, mjx-container'))
  .map(one => one.outerHTML.slice(0, 100)).slice(0, 3)"""


# ---------------------------------------------------------------- scenes


def ready(iframe):
    """The scene inside an iframe, once it is drawn."""
    iframe.scroll_into_view_if_needed()
    scene = iframe.content_frame
    scene.locator("#clock").filter(has_text="frame").wait_for(timeout=60_000)
    return scene


def colours(picture):
    return len(np.unique(picture.reshape(-1, 3), axis=0))


def changed(picture, before):
    """How many pixels became others."""
    return int((np.abs(picture - before).max(-1) > 40).sum())


def frame_number(scene):
    return int(scene.locator("#frame").input_value())


def check_scene(page, iframe):
    """It draws something, moves when played, stops, and follows the slider and the speed."""
    scene = ready(iframe)
    pane = scene.locator("#pane")
    until(lambda: colours(pixels(pane)) > 100, message="the pane stays empty")
    drawn = pixels(pane)
    last = int(scene.locator("#frame").get_attribute("max"))
    scene.locator("#speed").select_option("0.25")  # it shall not end before we look
    scene.locator("#play").click()
    assert scene.locator("#play").inner_text() == "Pause"
    until(lambda: frame_number(scene) > 0, message="it does not play")
    scene.locator("#play").click()
    assert scene.locator("#play").inner_text() == "Play"
    reached = frame_number(scene)
    page.wait_for_timeout(200)
    assert frame_number(scene) == reached  # it rests
    scene.locator("#frame").focus()
    page.keyboard.press("Home")
    assert scene.locator("#clock").inner_text() == f"frame 0 of {last}, 0.00 s"
    for _ in range(2):
        page.keyboard.press("ArrowRight")
    assert frame_number(scene) == 2
    scene.locator("#frame").fill(str(last // 2))
    until(lambda: changed(pixels(pane), drawn) > 300, message="the arm is not elsewhere")
    assert scene.locator("#pane").get_attribute("aria-label") == iframe.get_attribute("title")
    assert f"frame {last // 2}" in scene.locator("#frame").get_attribute("aria-valuetext")


@pytest.mark.parametrize("name", with_embeds(SCENE) if PAGES else [])
def test_every_scene_draws_and_moves_when_played(browser, name):
    with opened(browser) as page:
        go(page, name)
        scenes = page.locator(f"{SCENE}:visible").all()
        if not scenes:  # the page has a panel that begins with words
            _, control, count = controls_of(page.locator(PANEL).first)[0]
            for position in range(count):
                put(control, position)
                scenes = scenes or page.locator(f"{SCENE}:visible").all()[:1]
                if scenes:
                    break
        assert scenes
        for iframe in scenes:
            check_scene(page, iframe)
            assert (
                iframe.content_frame.locator("#words")
                .inner_text()
                .startswith("Left cube, as the robot sees it: ")
            )


def test_a_saved_scene_is_a_page_of_its_own(browser, tmp_path):
    samples = load_samples("recording")
    scene3d.sample_scene(samples, 90, eye=True).save(tmp_path / "scene.html")
    with opened(browser) as page:
        page.goto((tmp_path / "scene.html").as_uri())
        page.locator("#clock").filter(has_text="frame").wait_for(timeout=60_000)
        until(lambda: colours(pixels(page.locator("#pane"))) > 100)
        page.locator("#play").click()
        until(lambda: int(page.locator("#frame").input_value()) > 0)


def test_a_scene_whose_script_is_missing_says_so(browser, tmp_path):
    """Without a script of its own, which a careful server would forbid."""
    page = scene3d.sample_scene(load_samples("recording"), 90).html(shared=True)
    (tmp_path / "scene.html").write_text(page.replace(viewer.ROOT, ""), "utf-8")
    context = browser.new_context(offline=True)
    shown = context.new_page()
    shown.goto((tmp_path / "scene.html").as_uri())
    late = shown.locator("#late")  # hidden at first, since a script may come late
    assert late.evaluate("one => getComputedStyle(one).animationDelay") == "5s"
    late.wait_for()
    assert shown.locator("#clock").inner_text() == "_static/scene.js is missing"
    (tmp_path / "_static").mkdir()
    shutil.copyfile(SITE / viewer.SHARED_SCRIPT, tmp_path / viewer.SHARED_SCRIPT)
    shown.reload()
    shown.locator("#clock").filter(has_text="frame 0").wait_for()
    assert "missing" not in shown.locator("#clock").inner_text()
    context.close()


def test_the_camera_view_follows_the_frames(browser):
    with opened(browser) as page:
        go(page, "01_simulation.html")
        scene = ready(page.locator(SCENE).first)
        before = pixels(scene.locator("#eye canvas"))
        scene.locator("#frame").fill("44")
        assert changed(pixels(scene.locator("#eye canvas")), before) > 300


def test_a_slower_speed_is_slower(browser):
    """By the page's own clock: how soon a picture is drawn differs from machine to machine."""
    with opened(browser) as page:
        go(page, "01_simulation.html")
        scene, frames_per_s = ready(page.locator(SCENE).first), {}
        for speed in ("1", "0.25"):
            scene.locator("#frame").fill("0")
            scene.locator("#speed").select_option(speed)
            scene.locator("#play").click()
            until(lambda scene=scene: frame_number(scene) > 0)
            first, begun = scene.locator("#frame").evaluate(NOW)
            page.wait_for_timeout(1200)
            last, ended = scene.locator("#frame").evaluate(NOW)
            scene.locator("#play").click()
            frames_per_s[speed] = (last - first) / (ended - begun) * 1000
        assert frames_per_s["1"] > 2 * frames_per_s["0.25"]


NOW = "one => [Number(one.value), performance.now()]"


def test_a_scene_follows_the_theme(browser):
    with opened(browser) as page:
        go(page, "01_simulation.html")
        scene = ready(page.locator(SCENE).first)
        pane = scene.locator("#pane")
        until(lambda: pixels(pane)[5, 5].mean() > 200, message="it is not light")
        page.evaluate("document.documentElement.dataset.theme = 'dark'")
        until(lambda: pixels(pane)[5, 5].mean() < 100, message="it is not dark")


def test_the_arm_on_the_front_page_plays_by_itself_unless_motion_is_unwanted(browser):
    with opened(browser) as page:
        go(page, "index.html")
        scene = ready(page.locator(f"{SCENE}:visible").first)
        page.wait_for_timeout(500)
        assert frame_number(scene) == 0
    with opened(browser) as page:
        page.emulate_media(reduced_motion="no-preference")
        go(page, "index.html")
        scene = ready(page.locator(f"{SCENE}:visible").first)
        until(lambda: frame_number(scene) > 0, message="it does not play")
        assert scene.locator("#play").inner_text() == "Pause"


# ---------------------------------------------------------------- panels


def controls_of(panel):
    """Each control with the number of its positions."""
    found = []
    for row in panel.locator("[data-values]").all():
        control = row.locator("input, select")
        found.append((row, control, len(json.loads(row.get_attribute("data-values")))))
    return found


def put(control, position):
    """Move a control as its reader does: a slider by the keyboard, a choice by its list."""
    if control.evaluate("one => one.tagName") == "SELECT":
        control.select_option(str(position))
        return
    control.focus()
    if int(control.input_value()) > position:
        control.press("Home")
    for _ in range(position - int(control.input_value())):
        control.press("ArrowRight")


def test_icons_are_drawn(browser):
    """Those that the theme puts into a page; the others are left out of its script."""
    with opened(browser) as page:
        page.goto((SITE / "index.html").as_uri())
        page.locator("svg[data-icon]").first.wait_for(state="attached")
        drawn = page.locator("svg[data-icon] path").evaluate_all(
            "all => all.map(one => one.getAttribute('d')?.length ?? 0)")  # fmt: skip
        assert len(drawn) > 8 and min(drawn) > 10
        assert page.locator("i[class*='fa-'], svg[data-icon=missing], .fa-missing").count() == 0
    script = SITE / "_static" / "scripts" / "fontawesome.js"
    assert script.stat().st_size < 200_000


@pytest.mark.parametrize("name", [name for name in PAGES if "/" not in name])
def test_a_page_is_light_until_more_is_asked_for(browser, name):
    """By the files that it loads, none of which is counted twice."""
    loaded = set()
    with opened(browser) as page:
        page.on("response", lambda one: one.url.startswith("file:") and loaded.add(one.url))
        page.goto((SITE / name).as_uri())
        page.wait_for_timeout(1000)  # for what the page's scripts load
        paths = [Path(url2pathname(urlsplit(url).path)) for url in loaded]
        size = sum(path.stat().st_size for path in paths)
        print(name, round(size / 1e6, 2), "MB")
        symbols = 100_000 if name == "glossary.html" else 0  # it begins with formulas
        assert len(paths) > 10 and size < PAGE_BYTES + symbols


SHOWN_NOW = """panel => {
  const [frame, ...others] = [...panel.querySelectorAll("[data-frame]")]
    .filter(one => one.checkVisibility());
  const picture = frame.querySelector("img:not(.ptae-still img), iframe");  // no stills of paper
  let digest = 0;
  for (const letter of frame.innerHTML) digest = (31 * digest + letter.codePointAt(0)) | 0;
  return {
    digest, alone: others.length === 0, text: frame.innerText, picture: picture !== null,
    told: picture && (picture.alt || picture.title),
    drawn: !picture || (picture.checkVisibility()
                        && (picture.tagName !== "IMG" || picture.naturalWidth > 0)),
    controls: [...panel.querySelectorAll("[data-values]")].map(row => {
      const control = row.querySelector("input, select");
      return {position: Number(control.value), said: row.querySelector("output")?.innerText,
              aria: control.getAttribute("aria-valuetext")};
    }),
  };
}"""


@pytest.mark.parametrize("name", with_embeds(PANEL) if PAGES else [])
def test_every_panel_changes_what_it_shows_at_each_position(browser, name):
    with opened(browser) as page:
        go(page, name)
        page.evaluate("document.querySelector('[data-late]') && lateFrames()")
        for panel in page.locator(PANEL).all():
            controls = controls_of(panel)
            values = [json.loads(row.get_attribute("data-values")) for row, *_ in controls]
            at = [int(control.input_value()) for _, control, _ in controls]
            shown, told = set(), set()
            for positions in product(*(range(count) for *_, count in controls)):
                for (_, control, _), before, position in zip(controls, at, positions, strict=True):
                    if before != position:
                        put(control, position)
                at = positions
                now = panel.evaluate(SHOWN_NOW)
                if not now["drawn"]:
                    until(lambda one=panel: one.evaluate(SHOWN_NOW)["drawn"], message="not drawn")
                    now = panel.evaluate(SHOWN_NOW)
                assert now["alone"]
                assert [one["position"] for one in now["controls"]] == list(positions)
                for one, own in zip(now["controls"], values, strict=True):
                    if one["said"] is not None:
                        assert one["said"] == one["aria"] == own[one["position"]]
                shown.add(now["digest"])
                if now["picture"]:
                    assert now["told"]
                    told.add(now["told"] + now["text"])
            order = json.loads(panel.get_attribute("data-order"))
            assert len(order) == np.prod([count for *_, count in controls])
            total = len(set(order))  # positions that show the same share a frame
            assert len(shown) == total
            assert not told or len(told) == total


def test_every_action_of_the_front_page_is_a_scene_that_plays(browser):
    with opened(browser) as page:
        go(page, "index.html")
        page.evaluate("lateFrames()")
        panel = page.locator(PANEL).first
        controls = controls_of(panel)
        for positions in product(*(range(count) for *_, count in controls)):
            for (_, control, _), position in zip(controls, positions, strict=True):
                put(control, position)
            check_scene(page, panel.locator(f"{SCENE}:visible").first)


def test_panels_have_labels_and_can_be_reached_by_the_keyboard(browser):
    for name in with_embeds(PANEL):
        with opened(browser) as page:
            go(page, name)
            for panel in page.locator(PANEL).all():
                assert panel.get_attribute("role") == "group" and panel.get_attribute("aria-label")
                for _, control, _ in controls_of(panel):
                    assert control.evaluate("one => one.labels[0].innerText.trim()")
                    control.focus()
                    assert control.evaluate("one => one === document.activeElement")


# ---------------------------------------------------------------- paper, search, downloads


def test_a_page_prints_with_stills_in_the_place_of_scenes(browser):
    for name in ("index.html", "01_simulation.html"):
        with opened(browser) as page:
            go(page, name)
            page.emulate_media(media="print")
            assert page.locator(f"{SCENE}:visible").count() == 0
            still = page.locator(".ptae-still img:visible").first
            still.scroll_into_view_if_needed()
            assert still.evaluate("one => one.naturalWidth") > 100
            SHOTS.mkdir(parents=True, exist_ok=True)
            pdf = page.pdf(path=SHOTS / f"{name.removesuffix('.html')}.pdf", format="A4")
            assert pdf.count(b"/Type /Page\n") or pdf.count(b"/Type /Page") > 1


def test_without_scripts_there_is_a_still(browser):
    context = browser.new_context(offline=True, java_script_enabled=False)
    page = context.new_page()
    page.goto((SITE / "01_simulation.html").as_uri(), wait_until="commit")
    page.locator(".ptae-still img").first.wait_for(state="visible")
    assert not page.locator(SCENE).first.is_visible()
    context.close()


def test_the_search_finds_words_of_the_chapters(browser):
    with opened(browser) as page:
        go(page, "search.html?q=autoencoder")
        page.locator("#search-results li").first.wait_for()
        assert page.locator("#search-results li a", has_text="thirty numbers").count() >= 1


def test_formulas_are_drawn(browser):
    with opened(browser) as page:
        page.goto((SITE / "03_crossmodal_transformer.html").as_uri())
        page.wait_for_load_state("load")
        assert page.locator("mjx-container").count() == 0
        page.locator(".math").first.scroll_into_view_if_needed()
        page.locator("mjx-container svg").first.wait_for()
        assert page.locator(".math.notranslate").count() <= page.locator("mjx-container").count()
