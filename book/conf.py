"""Sphinx: every chapter is run from its .md source and becomes a page that works offline."""

from __future__ import annotations

import importlib.util
import json
import os
import re
import shutil
from pathlib import Path

from sphinx.util import logging

from ptae_lite.display import viewer

logger = logging.getLogger(__name__)

project = "PTAE-lite"
author = copyright = "PTAE-lite authors"
extensions = ["myst_nb"]
# A chapter is a pair; the site is built from the source, and the .ipynb twin is left alone.
exclude_patterns = ["*.ipynb", "**/*.ipynb", "**/.ipynb_checkpoints", "_build"]

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
mathjax_path = "vendor/tex-svg.js"
mathjax3_config = {"options": {"enableMenu": False}}  # the menu would load parts from elsewhere

# --- the site
html_theme = "sphinx_book_theme"
html_title = "PTAE-lite"
html_theme_options = {
    "home_page_in_toc": True,
    "show_toc_level": 2,
    "navbar_persistent": [],  # its search field stands in the sidebar already
}
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
    """The two large scripts, each once: MathJax's one needed file of 24 MB, and the 3-D viewer."""
    if app.builder.format != "html":
        return
    package = Path(importlib.util.find_spec("sphinx-mathjax-offline").origin).parent
    target = Path(app.outdir, "_static", mathjax_path)
    target.parent.mkdir(parents=True, exist_ok=True)
    shutil.copyfile(package / "static" / "mathjax" / "tex-svg.js", target)
    Path(app.outdir, viewer.SHARED_SCRIPT).write_bytes(viewer.shared_script())


def finish(app, exception) -> None:
    """Record each chapter's run time and errors, and look for pages that need the network."""
    if exception is not None or app.builder.format != "html":
        return
    record = {}
    for name, metadata in app.env.nb_metadata.items():
        run = metadata.get("exec_data")
        if run:
            traceback = COLOUR_CODE.sub("", run["traceback"] or "")
            record[name] = {"seconds": run["runtime"], "traceback": traceback}
            if not run["succeeded"]:
                app.statuscode = 1  # fail, also where warnings are allowed
    path = Path(app.outdir).parent / "chapter_times.json"
    path.write_text(json.dumps(record, indent=1, sort_keys=True), encoding="utf-8")
    for page in sorted(Path(app.outdir).rglob("*.html")):
        for found in EXTERNAL.findall(page.read_text(encoding="utf-8")):
            logger.warning("%s loads something from elsewhere: %s", page.name, found)


def setup(app) -> None:
    app.connect("builder-inited", copy_scripts)
    app.connect("build-finished", finish)
