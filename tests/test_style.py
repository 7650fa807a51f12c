"""Figures for every reader: told apart by the colour-blind, the same bytes each time."""

import base64
import io
import json
import re
from itertools import combinations

import matplotlib.pyplot as plt
import numpy as np
import pytest
from matplotlib.colors import to_rgb
from PIL import Image

from ptae_lite.book.finding import ROOT
from ptae_lite.plots import incongruence as incongruence_plots
from ptae_lite.plots import style

# How the three kinds of dichromats see linear RGB: Machado, Oliveira and Fernandes 2009.
SEEN_BY = {
    "protanopes": [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216],
                   [-0.003882, -0.048116, 1.051998]],
    "deuteranopes": [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413],
                     [-0.011820, 0.042940, 0.968881]],
    "tritanopes": [[1.255528, -0.076749, -0.178779], [-0.078411, 0.930809, 0.147602],
                   [0.004733, 0.691367, 0.303900]],
}  # fmt: skip


def seen(colour, by):
    """A colour as somebody sees it, in Lab-like steps: lightness and two opponent channels."""
    srgb = np.array(to_rgb(colour))
    linear = np.where(srgb <= 0.04045, srgb / 12.92, ((srgb + 0.055) / 1.055) ** 2.4)
    r, g, b = np.clip(np.array(SEEN_BY[by]) @ linear, 0, 1)
    x = 0.4124 * r + 0.3576 * g + 0.1805 * b
    y = 0.2126 * r + 0.7152 * g + 0.0722 * b
    z = 0.0193 * r + 0.1192 * g + 0.9505 * b
    fx, fy, fz = np.cbrt([x / 0.9505, y, z / 1.089])
    return np.array([116 * fy - 16, 500 * (fx - fy), 200 * (fy - fz)])


@pytest.mark.parametrize("by", SEEN_BY)
def test_colours_that_stand_together_are_told_apart(by):
    together = [style.BLUE, style.ORANGE, style.RED, "#BBBBBB"]
    for one, other in combinations(together, 2):
        assert np.linalg.norm(seen(one, by) - seen(other, by)) > 15, (one, other)


def test_texts_in_colour_are_read_on_white():
    def luminance(colour):
        srgb = np.array(to_rgb(colour))
        linear = np.where(srgb <= 0.04045, srgb / 12.92, ((srgb + 0.055) / 1.055) ** 2.4)
        return linear @ [0.2126, 0.7152, 0.0722]

    for colour in style.RC["axes.prop_cycle"].by_key()["color"]:
        assert 1.05 / (luminance(style.ink(colour)) + 0.05) >= 4.5, colour
    assert style.ink("black") == "black"


def test_the_measure_finds_what_is_confused():
    assert np.linalg.norm(seen("#C00000", "deuteranopes") - seen("#806000", "deuteranopes")) < 15


def test_lines_that_stand_together_differ_in_more_than_colour():
    places = [
        incongruence_plots.LOOKS[place][1:] for place in ("action", "vision", "proprioception")
    ]
    models = list({label: look for label, _, *look in incongruence_plots.MODELS.values()}.values())
    for looks in (places, models):  # dash and mark
        assert all(len(set(part)) == len(looks) for part in zip(*looks, strict=True))
    assert len({hatch for _, hatch in incongruence_plots.FILLS.values()}) == len(
        incongruence_plots.FILLS
    )


def test_a_vector_figure_is_the_same_bytes_each_time():
    def drawn():
        with plt.rc_context(style.RC):
            figure, axes = plt.subplots()
            axes.plot([1, 2, 3], label="a")
            axes.legend()
            file = io.BytesIO()
            figure.savefig(file, format="svg", metadata={"Date": None})
        plt.close(figure)
        return file.getvalue()

    assert drawn() == drawn()


def test_no_text_in_a_figure_is_too_small_for_a_phone():
    sources = [*ROOT.glob("src/ptae_lite/*/*.py"), *ROOT.glob("book/**/*.md")]
    size = re.compile(r"fontsize\W{1,4}([\d.]+)")
    found = [(path.name, one) for path in sources for one in size.findall(path.read_text("utf-8"))]
    assert found and not [one for one in found if float(one[1]) < 8.5]  # points


def test_figures_of_all_pages_are_as_wide_as_a_phone_shows_them():
    widths = []
    for path in ROOT.glob("book/**/[0-9]*.ipynb"):
        for cell in json.loads(path.read_text("utf-8"))["cells"]:
            for output in cell.get("outputs", []):
                data = output.get("data", {})
                if "text/html" in data or "Viewer" in "".join(data.get("text/plain", "")):
                    continue  # a panel or a scene; the image is what stands in for it
                for kind in {"image/png", "image/jpeg"} & data.keys():
                    image = Image.open(io.BytesIO(base64.b64decode("".join(data[kind]))))
                    size = output["metadata"].get(kind, {})  # of images with two dots a pixel
                    widths.append((path.stem, size.get("width", image.width)))
    assert widths and not [one for one in widths if one[1] > 115 * style.WIDTH]
