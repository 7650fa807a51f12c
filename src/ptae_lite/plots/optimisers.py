"""Figures of how weights are updated."""

from __future__ import annotations

import matplotlib.pyplot as plt
import numpy as np
from jaxtyping import Float
from matplotlib.figure import Figure

from ptae_lite.plots import style


def singular_values(values: dict[str, Float[np.ndarray, " R"]]) -> Figure:
    """The singular values of some matrices, each divided by its largest, from large to small.

    Args:
        values: by the name of the matrix.
    """
    figure, axis = plt.subplots()
    for (name, own), colour in zip(values.items(), style.SERIES, strict=False):
        axis.plot(np.arange(1, len(own) + 1), own / own[0], ".-", color=colour, label=name)
    axis.set(xlabel="direction", ylabel="singular value, of the largest", yscale="log")
    figure.legend(loc="outside lower center", ncols=len(values))
    return style.closed(figure)
