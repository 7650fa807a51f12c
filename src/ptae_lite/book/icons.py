"""The theme brings two thousand icons, a million and a half bytes for each page; kept are those
that the site uses."""

from __future__ import annotations

import re
from pathlib import Path

SCRIPT = Path("_static", "scripts", "fontawesome.js")
# An entry of the script: a name, the icon's size, its other names, its letter, and its outline.
ICON = re.compile(
    r'(?:"([a-z0-9-]+)"|([a-z0-9]+)):\[\d+,\d+,\[([^\]]*)\],"[0-9a-f]+",(?:"[^"]*"|\[[^\]]*\])\],?'
)
USED = re.compile(r"\bfa-([a-z0-9-]+)")


def used(site: Path) -> set[str]:
    """The names of icons in the pages of a site, and in the scripts that make parts of them."""
    scripts = [
        path for path in Path(site, "_static").glob("scripts/*.js") if path.name != SCRIPT.name
    ]
    files = [*Path(site).rglob("*.html"), *scripts]
    return {name for path in files for name in USED.findall(path.read_text("utf-8"))}


def trimmed(script: str, names: set[str]) -> str:
    """The script with the icons of these names alone."""

    def kept(icon: re.Match) -> str:
        own = {icon[1] or icon[2], *re.findall(r'"([a-z0-9-]+)"', icon[3])}
        return icon[0] if own & names else ""

    return ICON.sub(kept, script)


def trim(site) -> None:
    """Leave the icons out that no page of a built site shows."""
    path = Path(site, SCRIPT)
    path.write_text(trimmed(path.read_text("utf-8"), used(site)), "utf-8", newline="\n")
