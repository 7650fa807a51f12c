"""The built site as files: no dead link, nothing from elsewhere, texts for pictures, small."""

import ast
import os
import re
import subprocess
import sys
from functools import cache
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urldefrag, urlsplit

import pytest
from pages import ROOT, SITE, page_names, stale

from ptae_lite.book import contents
from ptae_lite.book.chapters import chapter_files, notebook_files
from ptae_lite.errors import PTAEError

PAGES = page_names()
LOADED = {("script", "src"), ("img", "src"), ("iframe", "src"), ("source", "src"), ("audio", "src"),
          ("video", "src"), ("embed", "src"), ("object", "data")}  # fmt: skip
BOOK = ROOT / "book"
SOURCE = ROOT / "src" / "ptae_lite"


@pytest.fixture(autouse=True)
def site(request):
    if request.node.get_closest_marker("browser"):
        reason = stale()
        if reason:
            pytest.skip(reason)


class Page(HTMLParser):
    """What a page links to, loads, shows and can be pointed at."""

    def __init__(self, path: Path):
        super().__init__()
        self.ids, self.links, self.loads, self.images, self.text = set(), [], [], [], []
        self.feed(path.read_text(encoding="utf-8"))

    def handle_starttag(self, tag, attrs):
        attrs = dict(attrs)
        self.ids |= {attrs[key] for key in ("id", "name") if attrs.get(key)}
        if tag == "a" and attrs.get("href"):
            self.links.append(attrs["href"])
        for key in ("src", "data", "href"):
            if attrs.get(key) and ((tag, key) in LOADED or (tag == "link" and key == "href")):
                self.loads.append((tag, attrs.get("rel", ""), attrs[key]))
        if tag == "img":
            self.images.append(attrs)

    def handle_data(self, data):
        self.text.append(data)


@cache
def read(path: Path) -> Page:
    return Page(path)


def page(name: str) -> Page:
    return read(SITE / name)


def dead_links(name: str, links: list, root: Path = SITE) -> list:
    """Those that lead to no file of the site, or to no place in it."""
    dead = []
    for link in links:
        if urlsplit(link).scheme in ("http", "https", "mailto", "data"):
            continue
        target, place = urldefrag(link)
        path = (root / name).parent / unquote(urlsplit(target).path) if target else root / name
        inside = path.resolve().is_relative_to(root.resolve()) and path.is_file()
        anywhere = not place or path.suffix != ".html"
        if not inside or not (anywhere or unquote(place) in read(path.resolve()).ids):
            dead.append(link)
    return dead


@pytest.mark.browser
@pytest.mark.parametrize("name", PAGES)
def test_no_link_is_dead(name):
    links = set(page(name).links) | {what for *_, what in page(name).loads}
    assert dead_links(name, sorted(links - {"#"})) == []


@pytest.mark.browser
@pytest.mark.parametrize("name", PAGES)
def test_nothing_is_loaded_from_elsewhere(name):
    for tag, rel, what in page(name).loads:
        if tag == "link" and rel not in ("stylesheet", "preload", "icon", "shortcut icon"):
            continue
        assert urlsplit(what).scheme in ("", "data"), (tag, what[:100])
        assert not what.startswith("//")


@pytest.mark.browser
@pytest.mark.parametrize("name", PAGES)
def test_every_picture_has_a_text(name):
    missing = [
        one.get("src", "")[:80] for one in page(name).images if not one.get("alt", "").strip()
    ]
    assert missing == []
    files = [
        one["alt"] for one in page(name).images if re.match(r"_images|.*\.(png|svg)$", one["alt"])
    ]
    assert files == []  # a file's name is no text


@pytest.mark.browser
def test_style_sheets_load_nothing_from_elsewhere():
    for path in SITE.rglob("*.css"):
        assert not re.findall(r"url\(\s*[\"']?(?:https?:)?//", path.read_text(encoding="utf-8"))


@pytest.mark.browser
def test_the_site_is_small():
    megabytes = sum(path.stat().st_size for path in SITE.rglob("*") if path.is_file()) / 1e6
    assert 1 < megabytes < 45
    assert not list(SITE.rglob("*.map"))  # of the theme's own sources


@pytest.mark.browser
@pytest.mark.parametrize("md", notebook_files(BOOK), ids=lambda md: md.stem)
def test_a_chapter_can_be_downloaded_as_a_notebook(md):
    name = md.relative_to(BOOK).with_suffix("").as_posix()
    twin = SITE / "_sources" / f"{name}.ipynb"
    assert twin.read_bytes() == md.with_suffix(".ipynb").read_bytes()
    assert any(link.endswith(f"_sources/{name}.ipynb") for link in page(f"{name}.html").links)


@pytest.mark.browser
@pytest.mark.parametrize("md", chapter_files(BOOK), ids=lambda md: md.stem)
def test_a_chapter_sets_apart_what_it_takes_and_links_to_the_others(md):
    html = (SITE / f"{md.stem}.html").read_text("utf-8")
    assert '<p class="facts"><strong>Time:' in html
    assert '<p class="facts"><strong>' in html.split("<strong>Time:")[0]  # the objectives
    others = {f"{other.stem}.html" for other in chapter_files(BOOK) if other != md}
    body = html.split("<article")[1].split("</article")[0]
    named = {n for n in re.findall(r"[Cc]hapter (\d\d)", md.read_text("utf-8")) if n != md.stem[:2]}
    linked = {name[:2] for name in others if f'href="{name}"' in body}
    assert named <= linked | {n for n in named if not any(o.startswith(n) for o in others)}


@pytest.mark.browser
def test_the_front_page_lists_every_chapter_with_what_it_takes():
    text = " ".join(" ".join(page("index.html").text).split())
    for number, one in enumerate(contents.Contents(BOOK).chapters, start=1):
        assert f"{number} {one.title} {one.time} {one.needs}" in text
    for path in ("An evening", "A course", "A re-run"):
        assert path in text


@pytest.mark.browser
def test_figures_of_the_chapters_are_vectors():
    """Photographs stay bitmaps, and so do the few figures that consist of them."""
    kinds = [path.suffix for path in (SITE / "_images").iterdir()]
    assert kinds.count(".svg") > kinds.count(".png")


def test_dead_links_are_found(tmp_path):
    (tmp_path / "a.html").write_text('<p id="here"><a href="b.html">b</a>')
    (tmp_path / "b.html").write_text("")
    links = ["b.html", "#here", "a.html#here", "c.html", "#there", "b.html#here", "../x.html"]
    assert dead_links("a.html", links, tmp_path) == links[3:]
    assert dead_links("a.html", ["https://example.org", "mailto:a@b.c"], tmp_path) == []


# ---------------------------------------------------------------- sources of pages


def test_a_chapter_that_does_not_say_what_it_takes_is_refused(tmp_path):
    md = tmp_path / "01_x.md"
    md.write_text(
        "# X\n\n**Time:** an hour of reading. More.\n"
        "**Prerequisites:** none\n*at all*, or [this](p.md#q). The [primer](p.md) helps.\n\n"
    )
    assert contents.chapter(md) == ("01_x", "X", "an hour", "none at all, or this")
    md.write_text("# X\n\n**Time:** an hour.\n\n")
    with pytest.raises(PTAEError, match="01_x.md needs"):
        contents.chapter(md)


def test_the_table_of_contents_links_and_escapes(tmp_path):
    (tmp_path / "index.md").write_text("```{toctree}\n:caption: Chapters\n\n01_x\n```\n")
    (tmp_path / "01_x.md").write_text("# A < B\n\n**Time:** 1 h\n**Prerequisites:** none\n\n")
    html = contents.Contents(tmp_path)._repr_html_()
    assert '<a href="01_x.html">A &lt; B</a>' in html and "<td>1</td>" in html


def test_the_reference_has_every_module_of_the_library():
    pages = "".join(path.read_text("utf-8") for path in (BOOK / "api").glob("*.md"))
    listed = set(re.findall(r"automodule:: ([\w.]+)", pages))
    there = {
        "ptae_lite." + ".".join(path.relative_to(SOURCE).with_suffix("").parts)
        for path in SOURCE.rglob("*.py") if not path.stem.startswith("__")
    }  # fmt: skip
    assert listed == there


def test_every_name_in_the_glossary_stands_in_the_source():
    text = (BOOK / "glossary.md").read_text("utf-8").split("## Shapes")[0]
    names = set()
    for path in SOURCE.rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text("utf-8"))):
            names |= {getattr(node, key, None) for key in ("id", "attr", "arg", "name")}
    rows = [row.split("|")[2] for row in text.splitlines() if row.startswith("| $")]
    assert len(rows) > 10
    for row in rows:
        for name in re.findall(r"`(\w+)`", row):
            assert name in names, name


def test_every_reference_of_a_page_is_in_the_bibliography():
    known = set()
    for name in ("bibliography.md", "primer.md"):
        known |= set(re.findall(r"^\(([\w-]+)\)=$", (BOOK / name).read_text("utf-8"), re.M))
    assert {"ptae", "pgae", "pvae"} <= known
    for path in BOOK.glob("*.md"):
        for label in re.findall(r"\{ref\}`[^`]*<([\w-]+)>`", path.read_text("utf-8")):
            assert label in known, (path.name, label)


@pytest.mark.slow
def test_the_book_of_a_re_run_says_so_on_each_page(tmp_path):
    code = "import runpy, sys; print(runpy.run_path(sys.argv[1])['html_theme_options'])"
    for data, says in ((None, False), (tmp_path, True)):
        env = os.environ | ({"PTAE_DATA": str(data)} if data else {})
        made = subprocess.run([sys.executable, "-c", code, BOOK / "conf.py"], env=env,
                              capture_output=True, text=True, check=True)  # fmt: skip
        assert ("Built from a re-run" in made.stdout) is says
