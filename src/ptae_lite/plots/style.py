"""The style of all figures: sizes, colours that colour-blind readers tell apart, stable files."""

from __future__ import annotations

import io

import matplotlib
import matplotlib.pyplot as plt
from IPython import get_ipython
from IPython.display import SVG
from IPython.display import Image as DisplayedImage
from matplotlib.figure import Figure
from matplotlib_inline.backend_inline import set_matplotlib_formats
from PIL import Image

from ptae_lite.run_mode import for_site

# Okabe and Ito's palette, safe for the common kinds of colour blindness
BLUE, ORANGE, GREEN, RED = "#0072B2", "#E69F00", "#009E73", "#D55E00"
PURPLE, SKY, GREY = "#CC79A7", "#56B4E9", "#6B6B6B"

MODELS = {  # one colour a model, on all pages
    "PTAE": BLUE, "PGAE": ORANGE, "PVAE": GREEN, "PRAE": RED, "linear baseline": PURPLE,
}  # fmt: skip
_INK = {ORANGE: "#8A6000", GREEN: "#007A59", RED: "#B34E00", PURPLE: "#A3527E", SKY: "#2177B0"}

PLAIN = {"fc": "white", "ec": "none", "pad": 0.5}  # behind a text that lines would cross

WIDTH = 4.4  # inches; in this width a figure is read on a phone as on a laptop, without scaling
DPI = 200  # of bitmaps: two dots a pixel of the page, sharp on a phone
PHOTO_DPI = 150  # of photos: four camera images side by side have no more dots

RC = {
    "figure.figsize": (WIDTH, 2.8),
    "figure.dpi": 110,
    "figure.constrained_layout.use": True,
    "font.size": 9,
    "axes.titlesize": 10,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": "#E4E4E4",
    "axes.prop_cycle": matplotlib.cycler(color=[BLUE, ORANGE, GREEN, RED, PURPLE, SKY, GREY]),
    "lines.linewidth": 1.6,
    "legend.frameon": False,
    "image.interpolation": "nearest",
    "svg.hashsalt": "ptae-lite",
}


def use() -> None:
    """Use this style for all figures of this process. On the site, figures are vectors."""
    plt.rcParams.update(RC)
    if for_site() and get_ipython() is not None:
        set_matplotlib_formats("svg", metadata={"Date": None})


def of_model(name: str, other: str | None = None) -> str | None:
    """The colour of a model or of a variant of it, such as `PTAE, long`; `other` for all else."""
    return MODELS.get(name.split(",")[0], other)


def ink(colour: str) -> str:
    """The colour for text on white: as it is, or a darker one that is read more easily."""
    return _INK.get(colour, colour)


def closed(figure: Figure) -> Figure:
    """The figure, closed in pyplot. An open one would be shown twice by a notebook."""
    plt.close(figure)
    return figure


def png(figure: Figure) -> bytes:
    """The figure as a PNG file of few colours. The same figure gives the same bytes."""
    return few_colours(_image(figure), 128 if _has_pictures(figure) else 32)


def few_colours(image: Image.Image, colours: int = 128) -> bytes:
    """The image as a PNG file of so many colours."""
    small = io.BytesIO()
    image.convert("RGB").quantize(colours, dither=0).save(small, "PNG", optimize=True)
    return small.getvalue()


def chart(figure: Figure) -> DisplayedImage | SVG:
    """The figure as the PNG of `png`, a third of the size that a notebook would make; on the site
    as a drawing, unless there are pictures in it.
    """
    if for_site() and not _has_pictures(figure):
        drawn = io.BytesIO()
        _save(figure, drawn, format="svg", metadata={"Date": None})
        return SVG(drawn.getvalue().decode())
    return DisplayedImage(png(figure), format="png", retina=True)


def photo(figure: Figure) -> DisplayedImage:
    """The figure as a JPEG; for noisy images it has a fifth of the size of a PNG."""
    small = io.BytesIO()
    _image(figure, PHOTO_DPI).save(small, "JPEG", quality=75, optimize=True)
    return DisplayedImage(small.getvalue(), format="jpeg", retina=True)


def _has_pictures(figure: Figure) -> bool:
    return any(axes.images for axes in figure.axes)


def _image(figure: Figure, dpi: int = DPI) -> Image.Image:
    drawn = io.BytesIO()
    _save(figure, drawn, format="png", dpi=dpi)
    return Image.open(drawn).convert("RGB")


def _save(figure: Figure, file: io.BytesIO, **how) -> None:
    # with the default layout on, a tight save would change a figure that has no layout
    with plt.rc_context({"figure.constrained_layout.use": False}):
        figure.savefig(file, bbox_inches="tight", **how)
