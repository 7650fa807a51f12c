"""Videos other than the recorded ones, for trainings that also use them.

A model that acts leaves the recorded course, and then sees what no recording shows. Two kinds of
videos prepare it for this. Either noise is added to recorded videos. Or a model acts in scenes of
training samples, and what it sees is paired with the recorded motion of that scene (data
aggregation, Ross et al. 2011, arXiv:1011.0686). Ours, not in the paper.
"""

from __future__ import annotations

import numpy as np

from ptae_lite import artefacts, vision
from ptae_lite.acting import Actor
from ptae_lite.data.samples import Samples
from ptae_lite.data.signals import STEPS
from ptae_lite.experiments.tasks import tasks_in
from ptae_lite.models.checkpoint import Trained
from ptae_lite.robot import closed_loop

NOISE = 0.3  # spread of the noise, as a share of the feature's spread over the training samples
COUNT = 2  # noisy videos for each sample


def make(
    kind: str, samples: Samples, indices, seed: int, base: Trained | None = None
) -> dict[int, list[np.ndarray]]:
    """Videos by sample number, features (99, F) each, as `training.train` takes them.

    Args:
        kind: `noisy` or `own episodes`.
        indices: the samples that are trained on.
        base: the model that acts in `own episodes`. It acts in half of the samples: in one half
            with even seeds, in the other with odd ones.
    """
    if kind == "noisy":
        return noisy(samples, indices, seed)
    seen = seen_in_own_episodes(base, samples, indices[seed % 2 :: 2])
    return {sample: [video] for sample, video in seen.items()}


def noisy(samples: Samples, indices, seed: int) -> dict[int, list[np.ndarray]]:
    """Recorded videos with noise on their features, `COUNT` for each sample."""
    rng, videos = np.random.default_rng([46, seed]), samples.features[:, :STEPS]
    spread = videos[indices].std((0, 1))
    return {
        i: [videos[i] + NOISE * spread * rng.standard_normal(videos[i].shape) for _ in range(COUNT)]
        for i in map(int, indices)
    }


def seen_in_own_episodes(trained: Trained, samples: Samples, indices) -> dict[int, np.ndarray]:
    """What a model's camera sees in its own episodes: features (99, F) by sample number."""
    encoder = vision.load_autoencoder(artefacts.stored("weights/cae.safetensors"))
    videos = {}
    for task in tasks_in(samples, indices):
        actor = Actor(trained, encoder, task.instruction)
        closed_loop.perform(task.stage, actor, limit=int(samples.frames[task.sample]) + 1)
        seen = np.stack(actor.looks)[:STEPS]
        rest = np.repeat(seen[-1:], STEPS - len(seen), axis=0)
        videos[task.sample] = np.concatenate([seen, rest])
    return videos
