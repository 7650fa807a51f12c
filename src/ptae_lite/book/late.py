"""What panels hide at first stands in a script beside the page, loaded when one is touched.

A panel of scenes or drawings is up to a megabyte and a half, of which a page shows one frame. The
script is packed: scenes are much alike.
"""

from __future__ import annotations

import json
import re
from pathlib import Path

from ptae_lite.book import lighter
from ptae_lite.widgets import viewer

FOLDER = Path("_static", "late")
HIDDEN = re.compile(r'(<template)>(.*?)(?=</template>)|data-packed="([^"]*)"', re.DOTALL)
WORTH = 50_000  # letters; less is left in the page


def taken(page: str, script: str) -> tuple[str, list[str]]:
    """A page without what its panels hide at first, and the texts that were there.

    Args:
        script: where the page finds the script with these texts.
    """
    texts = []

    def away(found: re.Match) -> str:
        texts.append(found[2] if found[1] else found[3])
        place = f'data-late="{len(texts) - 1}"'
        return f"{found[1]} {place}>" if found[1] else place

    made = HIDDEN.sub(away, page)
    if sum(map(len, texts)) < WORTH:
        return page, []
    return made.replace("<html", f'<html data-late-script="{script}"', 1), texts


def take(site) -> None:
    """Move what the panels of a built site hide at first out of its pages.

    Scenes are told the way to the site's root before, since a script beside a page has no own.
    """
    site = Path(site)
    for path in site.rglob("*.html"):
        name = path.relative_to(site).with_suffix(".js")
        if "_static" in name.parts:
            continue
        place = FOLDER / "-".join(name.parts)
        root = "../" * (len(name.parts) - 1)
        before = path.read_text("utf-8")
        page, texts = taken(before.replace(viewer.ROOT, root), root + place.as_posix())
        if page != before:
            path.write_text(page, "utf-8", newline="\n")
        if texts:
            Path(site, place).parent.mkdir(exist_ok=True)
            script = f"takeLate({json.dumps(texts, ensure_ascii=False)});\n"
            Path(site, place).write_bytes(lighter.packed(script.encode(), "lateTaken"))
