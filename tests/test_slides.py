"""Slides of a chapter: which parts of it are shown, and what a browser makes of them."""

import re

import pytest
from nbformat.v4 import new_code_cell, new_markdown_cell, new_notebook, new_output
from pages import FLAGS, ROOT, chromium_path

from ptae_lite.book import lecture, slides

ADDRESS = re.compile(r"(?:src|href)=[\"']?\s*(?:https?:)?//", re.IGNORECASE)

TOLD = """\
# A title

First words with $a<b$, a [link](https://example.org/x) and 3 mm<!--{x} mm-->.

**After this chapter you can**

- name it;
- see {doc}`01_simulation`.

**Time:** an hour.
"""
SECTION = """\
## A question?

*7 minutes*

Said before the formula:

$$
E = \\sum_i x_i
$$

Said before the figure.
"""
AFTER = """\
**Figure 1.1.** What to *see*.

> **Key result.** It holds,
> always.

> **In depth.** [Elsewhere](in_depth/x.md) there is more.

<details><summary>More</summary>

- folded

</details>

Said last.

## Exercises

1. Not shown.
"""
CODE = "for i in range(3):\n    print(i)"
GUESS = '<div data-ptae-embed="guess">Predict first.</div>'


@pytest.fixture
def chapter():
    """A chapter that has run, with every mark once."""

    def image(mime, data):
        return new_output("display_data", {mime: data, "text/plain": "<Figure>"})

    shown = new_code_cell(
        CODE,
        outputs=[
            new_output("stream", name="stdout", text="0\n1"),
            new_output("stream", name="stdout", text="\n2\n"),
        ],
    )
    folded = new_code_cell("plot()", outputs=[image("image/svg+xml", "<svg/>")])
    folded.metadata = {"tags": ["hide-input"], "mystnb": {"image": {"alt": "A 'line'"}}}
    asked = new_code_cell(
        "guess()",
        metadata={"tags": ["remove-input"]},
        outputs=[new_output("execute_result", {"text/html": GUESS})],
    )
    quiet = new_code_cell(
        "import x\ntier()",
        metadata={"tags": ["hide-input"]},
        outputs=[
            new_output("execute_result", {"text/plain": "'replay'"}),
            new_output("display_data", {"text/html": "<span>2 of 2 done</span>"}),
        ],
    )
    return new_notebook(cells=[
        new_markdown_cell(TOLD), quiet, new_markdown_cell(SECTION), folded,
        new_markdown_cell(AFTER.split("> **Key")[0]), shown, asked,
        new_markdown_cell("> **Key" + AFTER.split("> **Key")[1]),
    ])  # fmt: skip


def test_what_a_chapter_shows_is_a_slide(chapter):
    first, second = slides.cut(chapter)
    assert [one.kind for one in first.slides] == ["title", "list"]
    kinds = ["section", "formula", "figure", "code", "guess", "box"]
    assert [one.kind for one in second.slides] == kinds
    section, formula, figure, code, guess, box = second.slides
    assert "7 minutes" in section.caption
    assert "Said before the formula" in formula.html and "\\[E = \\sum_i x_i\\]" in formula.html
    assert 'alt="A &#x27;line&#x27;"' in figure.html and "What to <em>see</em>" in figure.caption
    assert "<pre>0\n1\n2</pre>" in code.html and "range" in code.html
    assert GUESS in guess.html
    assert "<h3>Key result</h3>" in box.html and "It holds,\nalways." in box.html
    assert "name it" in first.slides[1].html and "After this chapter" in first.slides[1].html


def test_what_a_chapter_tells_is_said_with_the_slide_after_it(chapter):
    first, second = slides.cut(chapter)
    title, outcomes = first.slides
    assert "First words" in outcomes.notes[0] and "**Time:**" in outcomes.notes[-1]
    assert second.slides[2].notes == ["Said before the figure."]
    assert second.slides[-1].notes[-1] == "Said last." and not title.notes


def test_slides_lead_nowhere_and_show_no_comments(chapter):
    page = slides.page(slides.cut(chapter))
    assert not ADDRESS.search(page) and "example.org" not in page
    assert "<!--" not in page and "{doc}" not in page and "chapter 01" in page
    assert "Not shown" not in page and "folded" not in page
    assert "\\(a&lt;b\\)" in page and "there is more" not in page.split("notes")[0]
    assert re.findall(r'<script src="([^"]+)"', page) == [
        "_static/reveal/reveal.js", "_static/reveal/notes.js", "_static/vendor/tex-svg.js"
    ]  # fmt: skip


def test_an_output_without_a_picture_is_printed():
    made = new_output("execute_result", {"text/plain": "a < b"})
    (section,) = slides.cut(new_notebook(cells=[
        new_markdown_cell("# A"), new_code_cell("x", outputs=[made])
    ]))  # fmt: skip
    assert "<pre>a &lt; b</pre>" in section.slides[1].html


# ---------------------------------------------------------------- in a browser


@pytest.fixture
def folder(chapter, tmp_path):
    """The page of the chapter beside its scripts, with too much on one slide and a live panel."""
    long = "\n".join(f"print({i})" for i in range(60))
    button = "<div oninput=\"this.querySelector('output').value = event.target.value\">"
    panel = button + '<input type="range" min="0" max="9" value="0"><output>0</output></div>'
    chapter.cells[-1:-1] = [
        new_code_cell(long),
        new_code_cell("panel()", metadata={"tags": ["hide-input"]},
                      outputs=[new_output("display_data", {"text/html": panel})]),
    ]  # fmt: skip
    for name, data in lecture.scripts().items():
        path = tmp_path / "_static" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(data)
    (tmp_path / "x.html").write_text(slides.page(slides.cut(chapter)), encoding="utf-8")
    return tmp_path


NOW = "Reveal.getCurrentSlide()"
PLACES = """() => {
  const body = Reveal.getCurrentSlide().querySelector('.body'), shown = body.firstElementChild;
  const outer = body.getBoundingClientRect(), inner = shown.getBoundingClientRect();
  return [inner.top - outer.top, inner.left - outer.left, outer.bottom - inner.bottom,
          outer.right - inner.right, shown.clientWidth - shown.scrollWidth];
}"""


def seen(page, address):
    """Go through all slides of a page, and look that each shows all of itself."""
    page.goto(address)
    for _ in range(page.evaluate("Reveal.getTotalSlides()")):
        page.wait_for_function(f"{NOW}?.dataset.fitted")
        page.wait_for_timeout(100)
        where = page.evaluate(f"{NOW}.innerText")[:60]
        assert min(page.evaluate(PLACES)) > -2.5, where
        assert page.evaluate(f"Number({NOW}.querySelector('.content').style.zoom)") > 0.3, where
        yield page
        page.evaluate("Reveal.next()")


@pytest.fixture
def page():
    """A window of 1280 by 720 without a network; whatever goes wrong in it fails the test."""
    from playwright.sync_api import sync_playwright

    if chromium_path() is None:
        pytest.skip("no Chromium here; on Debian: apt-get install chromium")
    wrong = []
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=chromium_path(), args=FLAGS)
        context = browser.new_context(viewport={"width": 1280, "height": 720}, offline=True)
        made = context.new_page()
        made.on("pageerror", lambda error: wrong.append(str(error)))
        made.on("request", lambda asked: None
                if asked.url.startswith(("file:", "data:", "blob:", "about:"))
                else wrong.append(asked.url))  # fmt: skip
        yield made
        browser.close()
    assert not wrong


@pytest.mark.browser
def test_slides_fit_typeset_their_formulas_and_are_alive(folder, page):
    formulas, moved = 0, []
    for shown in seen(page, (folder / "x.html").as_uri()):
        formulas += shown.locator("section.present > section.present mjx-container").count()
        slider = shown.locator("section.present > section.present input[type=range]")
        if slider.count():
            slider.fill("7")
            moved.append(shown.locator("section.present > section.present output").inner_text())
    assert formulas >= 1 and moved == ["7"]


@pytest.mark.slow  # it runs the chapters once more; these two have every kind of panel
@pytest.mark.browser
@pytest.mark.parametrize("name", ("05_incongruence", "06_closed_loop"))
def test_the_slides_of_a_chapter_with_panels_fit(name, page, tmp_path):
    for path, data in lecture.scripts().items():
        (tmp_path / "_static" / path).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / "_static" / path).write_bytes(data)
    sections = slides.cut(lecture.ran(ROOT / "book" / f"{name}.md"))
    made = slides.page(sections)
    assert not ADDRESS.search(made)
    (tmp_path / f"{name}.html").write_text(made, encoding="utf-8")
    kinds = [one.kind for section in sections for one in section.slides]
    assert len(sections) > 3 and "figure" in kinds
    shown = list(seen(page, (tmp_path / f"{name}.html").as_uri()))
    assert len(shown) == len(kinds)


def test_the_course_has_its_slides(monkeypatch, tmp_path, chapter):
    """Chapters that are there become slides; a page of the site becomes a file."""
    book = tmp_path / "book"
    book.mkdir()
    (book / "index.md").write_text("```{toctree}\n:caption: Chapters\n\n01_a\n02_b\n```\n")
    (book / "01_a.md").write_text("# A title\n")
    (book / "data_sheet.md").write_text("# A sheet\n")
    monkeypatch.setattr(lecture, "ran", lambda md: chapter)
    asked = []
    made = lecture.files(book, asked.append)
    assert [md.name for md in asked] == ["data_sheet.md", "01_a.md"]
    assert {"slides/01_a.html", "slides/index.html", "data_sheet.html",
            "slides/_static/reveal/reveal.js", "slides/_static/reveal/LICENSE",
            "slides/_static/scene.js"} < set(made)  # fmt: skip
    for name, data in made.items():
        if name.endswith(".html"):
            assert not ADDRESS.search(data.decode()), name
        if name.endswith(".css"):
            assert b"url(http" not in data and b"@import" not in data
    assert b"A title" in made["slides/index.html"]


def test_a_page_becomes_a_file_of_text_and_tables():
    table = new_output("execute_result", {"text/html": "<table><tr><td>7</td></tr></table>"})
    text = "# On data\n\nSee {doc}`the sheet <data_sheet>`.\n\n```{include} x.md\n```\n\nEnd."
    made = lecture.document(new_notebook(cells=[
        new_markdown_cell(text), new_code_cell("table()", outputs=[table])
    ]))  # fmt: skip
    assert "<title>On data</title>" in made and "<td>7</td>" in made
    assert "See the sheet." in made and "End." in made
    assert "include" not in made and "table()" not in made
