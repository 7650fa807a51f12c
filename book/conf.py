"""Sphinx: every chapter is run from its .md source and becomes a page that works offline."""

from __future__ import annotations

import importlib.util
import json
import os
import re
import shutil
from pathlib import Path

import jupytext
from sphinx.util import logging

from ptae_lite import artefacts, run_mode
from ptae_lite.book import chapters, icons, late, lighter, marks, numbers
from ptae_lite.live import scripts
from ptae_lite.widgets import viewer

logger = logging.getLogger(__name__)

project = "PTAE-lite"
author = copyright = "PTAE-lite authors"
extensions = ["myst_nb", "sphinx.ext.autodoc", "sphinx.ext.napoleon"]
# A chapter is a pair; the site is built from the source, and the .ipynb twin is left alone.
# Exercises are no pages either: notebooks for students and instructors are made from them.
exclude_patterns = ["*.ipynb", "**/*.ipynb", "**/.ipynb_checkpoints", "_build", chapters.EXERCISES]
# Nor is what a reader laid beside the pages; ? stands for what a pattern would understand.
left_out = chapters.left_out(Path(__file__).parent)
exclude_patterns += [re.sub(r"[][*?]", "?", name) for name in left_out]

# --- notebooks
nb_execution_mode = "force"
nb_execution_timeout = 600
# A failing chapter is reported with its traceback by `finish` below, after the others have run
# too; raising at once would hide which else are broken.
nb_execution_raise_on_error = False
nb_merge_streams = True
nb_output_stderr = "remove"  # as in the twins: progress bars and a platform's warnings
# Sliders become HTML with a picture for each position: a page needs no kernel and no widget
# library, which would come from elsewhere. Vector figures go before their bitmaps.
os.environ["PTAE_STATIC"] = "1"
nb_ipywidgets_js = {}
nb_mime_priority_overrides = [
    ("html", "text/html", 0),
    ("html", "image/svg+xml", 10),
    ("html", "image/png", 20),
    ("html", "text/plain", 80),
    ("html", "application/vnd.jupyter.widget-view+json", 90),
]

# --- text and formulas
myst_enable_extensions = ["amsmath", "colon_fence", "deflist", "dollarmath"]
myst_heading_anchors = 3
mathjax_path = "vendor/mathjax.js"
mathjax3_config = {"options": {"enableMenu": False}}  # the menu would load parts from elsewhere

# --- the library's reference, from its docstrings
autodoc_member_order = "bysource"
autodoc_preserve_defaults = True  # a path as it is written, not as it is on this machine
autodoc_typehints_format = "short"
napoleon_use_rtype = False
default_role = "code"  # `x` in a docstring, as in Markdown

# --- the site
html_static_path = ["_static"]
html_favicon = "_static/icon.svg"  # or browsers ask a server for one that is not there
html_css_files = ["book.css"]
html_js_files = ["book.js"]
# Live parts: each page has two small scripts, and the rest comes when a reader asks for it.
asked = any("LivePart(" in page.read_text("utf-8") for page in Path(__file__).parent.glob("*.md"))
if live := asked and not scripts.missing():
    html_js_files += ["live/loader.js", "live/packs.js"]
html_use_index = html_domain_indices = False  # the search does their work
html_show_search_summary = False  # it would fetch pages, which a browser forbids in a folder
html_theme = "sphinx_book_theme"
html_title = "PTAE-lite"
html_theme_options = {
    "home_page_in_toc": True,
    "show_toc_level": 2,
    "navbar_persistent": [],  # its search field stands in the sidebar already
}
of_a_rerun = artefacts.data_folder() != artefacts.ROOT / "data"
if of_a_rerun:
    html_theme_options["announcement"] = (
        "Built from a re-run. Its report.md says which numbers it made; the others are the stored."
    )
html_context = {"default_mode": "auto"}  # light or dark as the reader's system is
html_show_sphinx = False

# What a page may not load: the source of a script, style sheet, image or frame on another host.
EXTERNAL = re.compile(
    r"<(?:script|img|iframe|source)\b[^>]*?\ssrc=[\"']?(?:https?:)?//[^\s\"'>]+"
    r"|<link\b(?=[^>]*?\srel=[\"']?(?:stylesheet|preload|icon|shortcut))[^>]*?\shref=[\"']?"
    r"(?:https?:)?//[^\s\"'>]+",
    re.IGNORECASE,
)
COLOUR_CODE = re.compile(r"\x1b\[[0-9;]*m")


def copy_scripts(app) -> None:
    """The two large scripts, each once and packed: MathJax's one needed file, the 3-D viewer."""
    if app.builder.format != "html":
        return
    package = Path(importlib.util.find_spec("sphinx-mathjax-offline").origin).parent
    target = Path(app.outdir, "_static", mathjax_path)
    target.parent.mkdir(parents=True, exist_ok=True)
    script = package / "static" / "mathjax" / "tex-svg.js"
    target.write_bytes(lighter.packed(script.read_bytes(), "formulasReady"))
    scene = lighter.packed(viewer.shared_script(), "sceneReady")
    Path(app.outdir, viewer.SHARED_SCRIPT).write_bytes(scene)


def write_live(app) -> None:
    """What live parts load: models, runtimes, and the licences of the scripts by others."""
    if asked and not live:
        logger.info("The scripts of package.json are not installed: pages show stored answers.")
    elif live and app.builder.name == "html":
        from ptae_lite.live import files  # PyTorch's exporter takes seconds

        files.write(Path(app.outdir, "_static", "live"))


def ask_numbers(app, docname, source) -> None:
    """Let a chapter's run work out the numbers in its text."""
    if "{code-cell}" in source[0] and numbers.COMMENT.search(source[0]):
        notebook = jupytext.reads(source[0], fmt="md:myst")
        numbers.ask(notebook)
        source[0] = jupytext.writes(notebook, fmt="md:myst")


def fill_numbers(app, doctree) -> None:
    """Numbers in the text are those of this run; where they should not move, say which did."""
    changed = marks.filled(app, doctree)
    if run_mode.tier() == "replay" and not of_a_rerun:
        name = app.env.docname
        for one in changed:
            logger.warning("%s: %s; python3 run.py notebooks %s", name, one, Path(name).name)


def offer_notebook(app, pagename, templatename, context, doctree) -> None:
    """The download button of a chapter gives its .ipynb twin as well as its source."""
    if Path(app.srcdir, f"{pagename}.ipynb").exists():
        context["ipynb_source"] = f"{pagename}.ipynb"


def copy_notebooks(app) -> None:
    for md in chapters.notebook_files(app.srcdir):
        twin = md.with_suffix(".ipynb")
        if twin.exists():
            to = Path(app.outdir, "_sources", twin.relative_to(app.srcdir))
            shutil.copyfile(twin, to)


def halve(app, env, docnames) -> None:
    """Sphinx reads the first half of the pages in one process, the rest in another: by turns, so
    that each has as many chapters to run."""
    docnames[:] = [*docnames[::2], *docnames[1::2]]


def drop_source_maps(app) -> None:
    """The theme's maps to its own sources are an eighth of the site, and no page uses one."""
    for path in Path(app.outdir, "_static").rglob("*.map"):
        path.unlink()


def how_it_ran(app, name: str) -> dict | None:
    """A chapter's seconds and its traceback; nothing for a page without code."""
    run = app.env.nb_metadata.get(name, {}).get("exec_data")
    if run:
        traceback = COLOUR_CODE.sub("", run["traceback"] or "")
        return {"seconds": run["runtime"], "traceback": traceback}


def tell(app, doctree) -> None:
    """Add a line to the list of the chapters that have ended, which `run.py book` shows."""
    name = app.env.docname
    if ran := how_it_ran(app, name):
        path = Path(app.outdir).parent / "chapters_ended.jsonl"
        with path.open("a", encoding="utf-8") as file:  # one short write: no lines are mixed
            file.write(json.dumps([name, ran]) + "\n")


def finish(app, exception) -> None:
    """Record each chapter's run time and errors, and look for pages that need the network."""
    if exception is not None or app.builder.format != "html":
        return
    copy_notebooks(app)
    drop_source_maps(app)
    if app.builder.name == "html":
        icons.trim(app.outdir)
        late.take(app.outdir)
        lighter.lighten(app.outdir)
    found = {name: how_it_ran(app, name) for name in app.env.nb_metadata}
    record = {name: ran for name, ran in found.items() if ran}
    if any(ran["traceback"] for ran in record.values()):
        app.statuscode = 1  # fail, also where warnings are allowed
    path = Path(app.outdir).parent / "chapter_times.json"
    path.write_text(json.dumps(record, indent=1, sort_keys=True), encoding="utf-8")
    for page in sorted(Path(app.outdir).rglob("*.html")):
        for found in EXTERNAL.findall(page.read_text(encoding="utf-8")):
            logger.warning("%s loads something from elsewhere: %s", page.name, found)


def setup(app) -> None:
    app.connect("builder-inited", copy_scripts)
    app.connect("builder-inited", write_live)
    app.connect("env-before-read-docs", halve)
    app.connect("doctree-read", tell)
    app.connect("source-read", ask_numbers)
    app.connect("doctree-read", fill_numbers)
    for mark in (marks.facts, marks.boxes, marks.captions, marks.chapter_links, marks.terms):
        app.connect("doctree-read", mark)
    app.connect("html-page-context", offer_notebook, priority=400)  # before the theme's buttons
    app.connect("build-finished", finish)
