"""Icons that no page shows are left out of the theme's script; the others stay, by any name."""

from ptae_lite.book import icons

ICONS = (
    '"arrow-up":[384,512,[8593],"f062","M1 2z"],',
    'search:[512,512,[128269,"find"],"f002","M3 4z"],',
    'sun:[512,512,[],"f185",["M5z","M6z"]]',
)
SCRIPT = f"var a={{{''.join(ICONS)}}};go(a);"


def test_icons_are_kept_by_name_and_by_other_name():
    made = icons.trimmed(SCRIPT, {"sun", "find"})
    assert made == SCRIPT.replace(ICONS[0], "")
    assert icons.trimmed(SCRIPT, set()) == "var a={};go(a);"


def test_names_come_from_pages_and_scripts(tmp_path):
    place = tmp_path / icons.SCRIPT
    place.parent.mkdir(parents=True)
    place.write_text(SCRIPT + "fa-moon")
    (tmp_path / "index.html").write_text('<i class="fa-solid fa-sun"></i>')
    (place.parent / "theme.js").write_text('"fa-arrow-up"')
    assert icons.used(tmp_path) == {"solid", "sun", "arrow-up"}
    icons.trim(tmp_path)
    assert "search" not in place.read_text() and "arrow-up" in place.read_text()
