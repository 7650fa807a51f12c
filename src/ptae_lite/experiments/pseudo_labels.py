"""Pseudo-labels: sentences for the clips that have none, found with the help of all clips.

With few labels the colour is the scarce word: action, speed and side of a clip are read by a linear
map from a tenth of the labels. But the unlabelled clips show the same few cubes again and again.
So the colours are spread along a graph of scenes (label propagation, Zhou et al. 2004): a clip
tells the colour of its cube to the clips whose scenes look most like its own, these tell it on.

Ours; the paper leaves the unlabelled clips to the repeat signals.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from jaxtyping import Float, Int

from ptae_lite.baselines import linear_read
from ptae_lite.data.samples import Samples
from ptae_lite.data.splits import patterns_of
from ptae_lite.language import COLOURS, SIDES, Pattern, patterns

# Chosen on the split `fit`, by the colours of its unlabelled clips with eight lists of labels.
NEIGHBOURS = 8  # of each scene
SPREAD = 0.9  # of a scene's colour that comes from its neighbours; the rest from its own label
WHITENED = 0.5  # the exponent of the whitening, as of a model's features


def pseudo_labelled(samples: Samples, split: str, labelled: Int[np.ndarray, " M"]) -> Samples:
    """The samples, where each clip of the split without a label has a sentence that was found.

    A found sentence stands as the pattern of the clip: one of the split that has this sentence and
    the cube on the side that was found. Sentences of unlabelled clips are not used.

    Args:
        labelled: numbers of the samples that keep their own sentence.
    """
    indices = samples.split(split)
    without = np.setdiff1d(indices, labelled)
    action, speed, side = (
        linear_read(samples, labelled, without, name) for name in ("action", "speed", "side")
    )
    colour = spread_colours(samples, indices, labelled)
    own = [patterns()[i] for i in patterns_of(split, samples.holdout)]
    pattern = samples.pattern.copy()
    for i, act, pace, place in zip(without, action, speed, side, strict=True):
        pattern[i] = _pattern(
            own, act, str(colour[place][np.searchsorted(indices, i)]), pace, place
        )
    return replace(samples, pattern=pattern)


def _pattern(own: list[Pattern], action: str, colour: str, speed: str, side: str) -> int:
    """The index of the first pattern with this sentence and, if there is one, with this side."""
    found = [p for p in own if tuple(p.meaning) == (action, colour, speed)]
    return next((p for p in found if p.side == side), found[0]).index


def spread_colours(samples: Samples, indices, labelled) -> dict[str, np.ndarray]:
    """The colour of the left and of the right cube in each of some clips, (M,) names by side.

    Args:
        indices: numbers of the clips, sorted.
        labelled: those of them whose sentence names the colour of the cube that is moved.
    """
    graph = scene_graph(scenes(samples, indices))
    found = {}
    for side in SIDES:
        known = [i for i in labelled if patterns()[samples.pattern[i]].side == side]
        named = [COLOURS.index(patterns()[samples.pattern[i]].target_colour) for i in known]
        labels = np.zeros((len(indices), len(COLOURS)))
        labels[np.searchsorted(indices, known), named] = 1
        labels /= labels.sum(0).clip(1)  # a colour that is named more often weighs no more
        found[side] = np.array(COLOURS)[spread(graph, labels).argmax(1)]
    return found


def scenes(samples: Samples, indices) -> Float[np.ndarray, "M F"]:
    """What the first frames show besides the arm: features, half-whitened.

    The part of the features that follows from the joints is taken out. In the authors' data the
    first pose differs from clip to clip, and hides cubes.
    """
    joints = samples.joints[indices, 0].astype(float)
    joints = (joints - joints.mean(0)) / joints.std(0).clip(1e-6)
    first, second = np.triu_indices(joints.shape[1])
    pose = np.column_stack([np.ones(len(joints)), joints, joints[:, first] * joints[:, second]])
    seen = samples.features[indices, 0].astype(float)
    seen = seen - pose @ np.linalg.lstsq(pose, seen, rcond=None)[0]
    variance, axes = np.linalg.eigh(np.cov(seen.T))
    return seen @ axes * variance.clip(1e-9 * variance.max()) ** (-WHITENED / 2)


def scene_graph(scenes: Float[np.ndarray, "M F"]) -> Float[np.ndarray, "M M"]:
    """Edges between each scene and its nearest ones, normalised by the degrees of both ends.

    The weight is exp(-d^2 / (r s)), where r and s are the distances of the two scenes to the last
    of their own neighbours.
    """
    squares = ((scenes[:, None] - scenes[None]) ** 2).sum(-1)
    np.fill_diagonal(squares, np.inf)
    near = np.argsort(squares, axis=1, kind="stable")[:, :NEIGHBOURS]
    row = np.arange(len(scenes))[:, None]
    reach = np.sqrt(squares[row, near][:, -1])
    edges = np.zeros_like(squares)
    edges[row, near] = np.exp(-squares[row, near] / (reach[row] * reach[near]).clip(1e-12))
    edges = np.maximum(edges, edges.T)
    degree = np.sqrt(edges.sum(1))
    return edges / (degree[:, None] * degree)


def spread(
    graph: Float[np.ndarray, "M M"], labels: Float[np.ndarray, "M C"]
) -> Float[np.ndarray, "M C"]:
    """What each node has when labels no longer change as they spread: (1 - a G)^-1 L."""
    return np.linalg.solve(np.eye(len(graph)) - SPREAD * graph, labels)
