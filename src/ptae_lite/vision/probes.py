"""Linear probes: what a linear map can tell from the features.

A probe is fitted on training samples and scored on test samples. If a linear map finds a quantity,
the features hold it in a form that is easy to use. If it does not, the features may still hold it
in another form.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from ptae_lite.data.samples import Samples
from ptae_lite.errors import ConfigError
from ptae_lite.language import ACTIONS, COLOURS, SIDES, patterns

PENALTY = 1e-3  # of ridge regression, for each sample; small, to keep the weights finite


@dataclass(frozen=True)
class LinearProbe:
    """A fitted linear map: `(features - mean) / spread @ weights + offset`.

    Attributes:
        mean: mean of the training features.
        spread: their standard deviation.
        weights: for F features and K targets.
        offset: mean of the targets.
    """

    mean: Float[np.ndarray, " F"]
    spread: Float[np.ndarray, " F"]
    weights: Float[np.ndarray, "F K"]
    offset: Float[np.ndarray, " K"]

    def numbers(self, features: Float[np.ndarray, "S F"]) -> Float[np.ndarray, "S K"]:
        """The K predicted numbers of each sample, in the units of the targets.

        Raises:
            ConfigError: the features are not (S, F).
        """
        if np.ndim(features) != 2 or np.shape(features)[1] != len(self.mean):
            raise ConfigError(
                f"this probe takes samples x {len(self.mean)} features, not {np.shape(features)}"
            )
        return (features - self.mean) / self.spread @ self.weights + self.offset

    def labels(self, features: Float[np.ndarray, "S F"]) -> Int[np.ndarray, " S"]:
        """The predicted class of each sample, for a probe that `fit_classifier` made."""
        return self.numbers(features).argmax(1)


def fit_regression(features, targets, penalty: float = PENALTY) -> LinearProbe:
    """Ridge regression of `targets` (S, K) on `features` (S, F).

    It scales the features to mean 0 and spread 1 (`z`) and minimises over the weights `W`

    ::

        mean |z W + offset - y|^2  +  penalty |W|^2.

    Raises:
        ConfigError: the arrays have other shapes, or different numbers of samples.
    """
    features, targets = np.asarray(features, dtype=float), np.asarray(targets, dtype=float)
    if features.ndim != 2 or targets.ndim != 2 or len(features) != len(targets):
        raise ConfigError(
            f"a linear probe is fitted on samples x features and samples x targets, "
            f"not on {features.shape} and {targets.shape}"
        )
    mean, spread = features.mean(0), np.maximum(features.std(0), 1e-12)
    scaled, offset = (features - mean) / spread, targets.mean(0)
    system = scaled.T @ scaled / len(scaled) + penalty * np.eye(scaled.shape[1])
    weights = np.linalg.solve(system, scaled.T @ (targets - offset) / len(scaled))
    return LinearProbe(mean, spread, weights, offset)


def fit_classifier(
    features, labels: Int[np.ndarray, " S"], penalty: float = PENALTY
) -> LinearProbe:
    """Ridge classifier: a regression on 1 for the right class and 0 for each other class."""
    labels = np.asarray(labels)
    return fit_regression(features, np.eye(labels.max() + 1)[labels], penalty)


def first(rows: Float[np.ndarray, "S T ..."]) -> np.ndarray:
    """The first frame of each sample."""
    return rows[:, 0]


def last(samples: Samples, rows: Float[np.ndarray, "S T ..."]) -> np.ndarray:
    """The last frame of each sample: 49 of a fast clip, 99 of a slow one, counted from 0."""
    return rows[np.arange(len(rows)), samples.frames - 1]


def colours(samples: Samples) -> dict[str, Int[np.ndarray, " S"]]:
    """Colours of the `left` and the `right` cube of each sample, as indices into `COLOURS`."""
    of = [patterns()[i] for i in samples.pattern]
    return {side: np.array([COLOURS.index(getattr(p, side)) for p in of]) for side in SIDES}


def action_and_side(samples: Samples) -> Int[np.ndarray, " S"]:
    """Action and side of each sample: 0 to 2 push, pull, slide on the left, 3 to 5 on the right."""
    of = [patterns()[i] for i in samples.pattern]
    return np.array([len(ACTIONS) * SIDES.index(p.side) + ACTIONS.index(p.action) for p in of])


def percent_right(samples: Samples, features, labels, penalty: float = PENALTY) -> float:
    """Percentage of the test samples whose class a linear probe finds from `features` (S, F)."""
    train, test = samples.split("train"), samples.split("test")
    read = fit_classifier(features[train], labels[train], penalty)
    return 100 * float((read.labels(features[test]) == labels[test]).mean())


def place_errors_mm(
    samples: Samples, features, cubes: Float[np.ndarray, "S 2 7"], penalty: float = PENALTY
) -> dict[str, float]:
    """Errors in millimetres of a linear probe for x and y of the two cubes, on test samples.

    Args:
        cubes: poses of the left and the right cube, position in metres first.

    Returns:
        `per_axis`, the root mean square error of the four coordinates; `distance`, the mean
        distance between a cube and its predicted place; `guess`, the per-axis error of always
        predicting the mean training place, as from features that know nothing of the places.
    """
    train, test = samples.split("train"), samples.split("test")
    places = 1000.0 * cubes[:, :, :2].reshape(len(cubes), 4)
    read = fit_regression(features[train], places[train], penalty)
    off = read.numbers(features[test]) - places[test]
    guess = places[train].mean(0) - places[test]
    return {
        "per_axis": float(np.sqrt((off**2).mean())),
        "distance": float(np.hypot(off[:, ::2], off[:, 1::2]).mean()),
        "guess": float(np.sqrt((guess**2).mean())),
    }
