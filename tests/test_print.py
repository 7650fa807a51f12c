"""Pages on paper: nothing is cut off, on A4 and on Letter, and dark pages print light."""

import pytest
from pages import chromium, go, opened, page_names, stale

MM_PER_INCH, MARGIN_MM = 25.4, 15  # the margin is that of book.css
SIZES = {"A4": 210, "Letter": 8.5 * MM_PER_INCH}  # width in mm
COLUMNS = 100  # of text that keeps its lines


@pytest.fixture(scope="module")
def browser():
    reason = stale()
    if reason:
        pytest.skip(reason)
    with chromium() as running:
        yield running


@pytest.mark.browser
@pytest.mark.parametrize("name", [name for name in page_names() if name != "search.html"])
def test_a_page_prints_whole_and_dark_on_white(browser, name):
    with opened(browser) as page:
        go(page, name)
        page.evaluate("addEventListener('afterprint', () => { window.printed = true; })")
        page.pdf(format="A4")  # with it the page is told to print
        assert page.evaluate("window.printed")
        for theme in ("light", "dark"):
            page.emulate_media(media="print", color_scheme=theme)
            page.wait_for_function(
                "theme => document.documentElement.dataset.theme === theme", arg=theme
            )
            page.evaluate("dispatchEvent(new Event('beforeprint'))")
            assert page.evaluate(PALE) == [], theme
            for size, width_mm in SIZES.items():
                width_px = (width_mm - 2 * MARGIN_MM) / MM_PER_INCH * 96
                page.set_viewport_size({"width": int(width_px), "height": 1000})
                assert page.evaluate(CUT_OFF) == [], f"{size}, {theme}"
                assert page.evaluate(BROKEN_LINES, COLUMNS) == [], f"{size}, {theme}"
            page.evaluate("dispatchEvent(new Event('afterprint'))")
            assert page.evaluate("document.documentElement.dataset.theme") == theme


# Texts and grounds that are not dark on light. Chips of code are text, too.
PALE = """() => {
  const light = colour => {
    const [r, g, b, a = 1] = colour.match(/[\\d.]+/g).map(Number);
    return a * (0.2126 * r + 0.7152 * g + 0.0722 * b) / 255 + 1 - a;
  };
  const texts = 'html, body, main :is(h1, h2, h3, p, li, td, th, pre, span)';
  return [...document.querySelectorAll(texts)]
    .filter(one => one.checkVisibility() && one.innerText.trim())
    .filter(one => light(getComputedStyle(one).color) > 0.6 ||
                   light(getComputedStyle(one).backgroundColor) < 0.8)
    .map(one => one.outerHTML.slice(0, 100)).slice(0, 3);
}"""
# What sticks out of the paper, or is cut off by the box it is in. The formulas' twins for screen
# readers are out of sight by design.
CUT_OFF = """() => {
  const width = document.documentElement.clientWidth, found = [];
  for (const one of document.querySelectorAll('body *:not(svg *, .math, mjx-assistive-mml *)')) {
    if (!one.checkVisibility()) continue;
    const box = one.getBoundingClientRect();
    const cut = one.scrollWidth > one.clientWidth + 1 && one.clientWidth &&
                getComputedStyle(one).overflowX !== 'visible';
    if (box.width && (box.right > width + 1 || box.left < -1 || cut))
      found.push(one.outerHTML.slice(0, 100));
  }
  return found.slice(0, 3);
}"""
# Code and tables of text whose lines are short enough, but wrapped all the same.
BROKEN_LINES = """columns => {
  const short = [...document.querySelectorAll('main pre')].filter(
    pre => pre.textContent.split('\\n').every(line => line.length <= columns));
  const heights = short.map(pre => pre.clientHeight);
  for (const pre of short) pre.style.whiteSpace = 'pre';
  const broken = short.filter((pre, i) => pre.clientHeight !== heights[i]);
  for (const pre of short) pre.style.whiteSpace = '';
  return broken.map(pre => pre.textContent.slice(0, 100)).slice(0, 3);
}"""
