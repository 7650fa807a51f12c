"""Scores of an image encoder: linear probes of its features, and the error of its images."""

from __future__ import annotations

import numpy as np
import torch

from ptae_lite import vision
from ptae_lite.data import frames
from ptae_lite.data.samples import Samples
from ptae_lite.language import SIDES
from ptae_lite.robot.recorder import load_sequence
from ptae_lite.vision import probes

MOMENTS = ("first", "early", "late", "last")  # the frames of each sample that are looked at
DRAWN = ((9, 0, 0), (14, 3, 55), (6, 1, 35), (9, 2, 45))  # frames of test patterns
PROBES = {"test": "train", "held_out": "fit"}  # scored on: fitted on


def moments(samples: Samples) -> np.ndarray:
    """Frame numbers (S, 4) of `MOMENTS`. The two in the middle differ between variations."""
    share = np.stack([0.2 + 0.05 * samples.variation, 0.5 + 0.05 * samples.variation])
    between = (share * samples.frames).astype(int)
    return np.stack([0 * samples.frames, *between, samples.frames - 1], axis=1)


def look(folder, samples: Samples) -> np.ndarray:
    """The images at `moments`, (S, 4, 120, 160, 3) bytes."""
    pairs = zip(samples.pattern, samples.variation, moments(samples), strict=True)
    return np.stack([load_sequence(folder, int(p), int(v)).images[t] for p, v, t in pairs])


def scores(encoder, images: np.ndarray, samples: Samples) -> dict[str, dict[str, float]]:
    """Scores of linear probes and of the reconstruction, for each of `PROBES`.

    Args:
        images: those of `look`.
    """
    codes = vision.encode_images(encoder, images.reshape(-1, *images.shape[2:]))
    codes = codes.reshape(*images.shape[:2], -1)
    return {
        split: probe_scores(codes, samples, split)
        | pixel_errors(encoder, images[samples.split(split)])
        for split in PROBES
    }


def probe_scores(codes: np.ndarray, samples: Samples, split: str) -> dict[str, float]:
    """Scores of linear probes of features (S, 4, F) at `moments`, in percent and millimetres."""
    known, asked = samples.split(PROBES[split]), samples.split(split)

    def read(fit, inputs, targets):
        return fit(inputs[known], targets[known])

    found = {}
    for at, name in ((0, "first"), (3, "last")):
        seen = codes[:, at]
        for kind, inputs in (("", seen), ("_products", with_products(seen, known))):
            hits = [
                read(probes.fit_classifier, inputs, labels).labels(inputs[asked]) == labels[asked]
                for labels in probes.colours(samples).values()
            ]
            found[f"{name}_both{kind}"] = 100 * (hits[0] & hits[1]).mean()
            if not kind:
                found |= {f"{name}_{s}": 100 * h.mean() for s, h in zip(SIDES, hits, strict=True)}
        frame = moments(samples)[:, at]
        places = 1000 * samples.cubes[np.arange(len(frame)), frame, :, :2].reshape(-1, 4)
        off = read(probes.fit_regression, seen, places).numbers(seen[asked]) - places[asked]
        found[f"{name}_place_mm"] = np.sqrt((off**2).mean())
        acts = probes.action_and_side(samples)
        right = read(probes.fit_classifier, seen, acts).labels(seen[asked]) == acts[asked]
        found[f"{name}_act"] = 100 * right.mean()
    found["joints_r2"] = joints_r2(codes, samples, known, asked)
    return {name: round(float(value), 4) for name, value in found.items()}


def with_products(inputs: np.ndarray, known) -> np.ndarray:
    """Features with mean 0 and spread 1 (over the samples `known`), and all products of two."""
    spread = inputs[known].std(0)
    unit = (inputs - inputs[known].mean(0)) / np.where(spread > 0, spread, 1)
    a, b = np.triu_indices(unit.shape[1])
    return np.c_[unit, unit[:, a] * unit[:, b]]


def joints_r2(codes, samples: Samples, known, asked) -> float:
    """R^2 of a linear probe for the joints: the mean over the five.

    It uses the two moments in the middle, because the arm is at home in the first and the last
    frame.
    """
    rows, at = np.arange(len(codes))[:, None], moments(samples)
    joints = samples.joints[rows, at][:, 1:3].astype(float)
    inner = codes[:, 1:3]
    (x, y), (x_asked, y_asked) = (
        (inner[of].reshape(-1, codes.shape[2]), joints[of].reshape(-1, 5)) for of in (known, asked)
    )
    off = probes.fit_regression(x, y).numbers(x_asked) - y_asked
    return float((1 - (off**2).sum(0) / ((y_asked - y_asked.mean(0)) ** 2).sum(0)).mean())


@torch.no_grad()
def pixel_errors(encoder, images: np.ndarray) -> dict[str, float]:
    """Root mean square error of the reconstruction (values 0 to 1).

    `pixel_error` is over all pixels, `colour_pixel_error` over strongly coloured ones.
    """
    sums, counts = np.zeros(2), np.zeros(2)
    for some in images:
        x = vision.as_input(some)
        square = (encoder(x) - x) ** 2
        coloured = (x.amax(1) - x.amin(1) > 0.5)[:, None].expand_as(x)
        for i, part in enumerate((square, square[coloured])):
            sums[i] += float(part.sum())
            counts[i] += part.numel()
    errors = np.sqrt(sums / counts).round(4).tolist()
    return dict(zip(("pixel_error", "colour_pixel_error"), errors, strict=True))


@torch.no_grad()
def drawn(encoder, images: np.ndarray | None = None) -> np.ndarray:
    """Images as an encoder reconstructs them, as bytes. None for the stored frames `DRAWN`."""
    x = vision.as_input(frames.images(DRAWN) if images is None else images)
    return vision.as_images(encoder(x))
