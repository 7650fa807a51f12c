"""Pages load less: no search where none is, pictures and formulas when they come near.

Drawings are squeezed: what Matplotlib writes for people to read is a fifth of them.
"""

from __future__ import annotations

import re
import shutil
import zlib
from functools import cache
from pathlib import Path

from PIL import Image

from ptae_lite.live.packing import BITS, FIRST, letters

# The theme loads the search with every page, for a search while one types, which is not used here.
SEARCH = re.compile(
    r'[ \t]*<script src="[^"]*(?:searchtools|language_data|searchindex|sphinx_highlight)\.js[^"]*">'
    r"</script>\n?"
)
FORMULAS = re.compile(r'[ \t]*<script\b[^>]*? src="([^"]*vendor/mathjax\.js[^"]*)"></script>\n?')
PICTURE = re.compile(r'<img\b(?![^>]*\sloading=)[^>]*?\ssrc="([^":]+)"[^>]*?(?=\s*/?>)')
SIZE = re.compile(r"""<svg\b[^>]*?\sviewBox=["'][\d.-]+ [\d.-]+ ([\d.]+) ([\d.]+)["']""")
POINT = 4 / 3  # pixels
SIGNATURE = re.compile(r'<dt class="sig\b.*?</dt>', re.DOTALL)
WORD = re.compile(r'<span class="pre">([^<]*)</span>')
METADATA = re.compile(r"<metadata>.*?</metadata>|<!--.*?-->|(?<=>)\n\s*(?=<)", re.DOTALL)
LONG = re.compile(r"(?<![\d.])[1-9]\d*\.\d{4,}")  # smaller numbers may be scales
PATH = re.compile(r'\sd="([^"]*)"')
SPACES = re.compile(r"\s+(?=[A-Za-z]|$)|(?<=[A-Za-z])\s+|(?<=\s)\s+")
UNPACK = """(() => {
  const text = "@TEXT@", bytes = new Uint8Array(@COUNT@ + 2); // a letter may reach beyond the end
  let bits = 0, have = 0, at = 0;
  for (let i = 0; i < text.length; i++) {
    bits = bits << @BITS@ | text.charCodeAt(i) - @FIRST@; // older bits fall out at the left
    for (have += @BITS@; have >= 8; have -= 8) bytes[at++] = bits >>> have - 8;
  }
  const packed = new Blob([bytes.subarray(0, @COUNT@)]).stream();
  const whole = new Response(packed.pipeThrough(new DecompressionStream("deflate"))).blob();
  window.@NAME@ = whole.then(found => new Promise((done, failed) => {
    const tag = document.createElement("script");
    tag.src = URL.createObjectURL(new Blob([found], {type: "text/javascript"}));
    tag.onload = done;
    tag.onerror = failed;
    document.head.append(tag);
  }));
})();
"""


def packed(script: bytes, name: str) -> bytes:
    """A script that unpacks another and runs it, in a third of its size.

    Args:
        name: of the global promise that is kept when the other has run.
    """
    small = zlib.compress(script, 9)
    made, parts = UNPACK, {"NAME": name, "COUNT": len(small), "BITS": BITS, "FIRST": FIRST}
    for part, value in (parts | {"TEXT": letters(small)}).items():  # the text comes last
        made = made.replace(f"@{part}@", str(value))
    return b"\xff\xfe" + made.encode("utf-16-le")


def without_search(page: str) -> str:
    """A page without the scripts of the search, a third of a megabyte."""
    return SEARCH.sub("", page)


def with_late_formulas(page: str) -> str:
    """A page that says where MathJax is, and leaves it to `book.js` to load it."""
    if not (found := FORMULAS.search(page)):
        return page
    without = page.replace(found[0], "")
    return without.replace("<html", f'<html data-formulas-script="{found[1]}"', 1)


def with_late_pictures(page: str, folder: Path) -> str:
    """A page whose pictures load when they come near; their place is kept free meanwhile.

    Args:
        folder: where the page is.
    """

    def late(found: re.Match) -> str:
        path = Path(folder, found[1])
        if not path.is_file() or not (size := size_px(path)):
            return found[0]
        given = "" if re.search(r"\s(?:width|height)=", found[0]) else ' width="{}" height="{}"'
        return f'{found[0]} loading="lazy"{given.format(*size)}'

    return PICTURE.sub(late, page)


def with_light_signatures(page: str) -> str:
    """A page whose signatures have no span around each word, an eighth of a page of the library."""
    return SIGNATURE.sub(lambda found: WORD.sub(r"\1", found[0]), page)


@cache
def size_px(path: Path) -> tuple[int, int] | None:
    """Width and height of a picture; None where a drawing does not say them."""
    if path.suffix != ".svg":
        with Image.open(path) as image:
            return image.size
    found = SIZE.search(path.read_text("utf-8")[:2000])
    return found and tuple(round(POINT * float(side)) for side in found.groups())


def squeezed(drawing: str) -> str:
    """An SVG file with nothing between its elements, and coordinates to a thousandth of a point."""
    made = METADATA.sub("", drawing)
    made = LONG.sub(lambda found: f"{float(found[0]):.3f}".rstrip("0").rstrip("."), made)
    return PATH.sub(lambda found: f' d="{SPACES.sub("", found[1])}"', made)


def lighten(site) -> None:
    """Rewrite the pages and drawings of a built site; what is light already stays as it is.

    The theme's words in other languages, which only the build reads, are deleted.
    """
    shutil.rmtree(Path(site) / "_static" / "locales", ignore_errors=True)
    for path in Path(site).glob("_images/*.svg"):
        path.write_text(squeezed(path.read_text("utf-8")), "utf-8", newline="\n")
    for path in Path(site).rglob("*.html"):
        if "_static" in path.parts or path.name == "search.html":
            continue
        page = path.read_text("utf-8")
        made = with_light_signatures(with_late_formulas(without_search(page)))
        made = with_late_pictures(made, path.parent)
        if made != page:
            path.write_text(made, "utf-8", newline="\n")
