"""The scores of chapter 03 for a policy that watches: words and joint error on recorded clips.

*Execute* is not free here. At every frame the policy is given the recorded image and the recorded
joints, and it is asked for the joints of the next frame.
"""

from __future__ import annotations

import numpy as np
import pandas as pd
import torch
from jaxtyping import Float

from ptae_lite.data import demonstrations
from ptae_lite.data.samples import MAX_FRAMES, Samples
from ptae_lite.data.signals import STEPS
from ptae_lite.evaluation import alternatives_for, evaluate, nrmse
from ptae_lite.language import patterns, says
from ptae_lite.models.checkpoint import Trained
from ptae_lite.robot import inverse
from ptae_lite.watching_training import Prepared, clip_codes, queries


def score(trained: Trained, samples: Samples, model: str, seed: int, split: str) -> pd.DataFrame:
    """A row of `watching_models.csv`, in percent.

    Beside the scores of the PTAE below, which does its four tasks as before,
    `describe_with_clock_accuracy` is the share of clips described rightly without padding.
    """
    indices = samples.split(split)
    row = {"model": model, "seed": seed, "split": split, "steps": trained.about["steps"],
           "seconds": trained.about["seconds"], "clips": trained.about["clips"]}  # fmt: skip
    scores = evaluate(trained, samples, split)
    data = Prepared.of(demonstrations.recorded(samples, indices), trained.scaling)
    scores["describe_with_clock_accuracy"] = 100 * describes(
        trained, data, samples.pattern[indices]
    )
    made = executed(trained, data, alternatives_for(len(samples.frames))[indices])
    scores["execute_nrmse"], scores["execute_nrmse_valid"] = nrmse(
        made, samples, indices, trained.scaling
    )
    return pd.DataFrame([row | {name: round(value, 3) for name, value in scores.items()}])


@torch.no_grad()
def describes(trained: Trained, data: Prepared, pattern) -> float:
    """The share of clips whose description is right."""
    model = trained.model
    codes, first = clip_codes(model, data), data.features[:, 0]
    said = model.tell(codes, data.frames.float(), first).argmax(2).numpy()
    meanings = [patterns()[i].meaning for i in pattern]
    return float(np.mean([says(one, what) for one, what in zip(said, meanings, strict=True)]))


@torch.no_grad()
def executed(trained: Trained, data: Prepared, alternative) -> Float[np.ndarray, "M 99 5"]:
    """The joints that the policy answers at each frame of recorded clips, in radians."""
    model, clip = trained.model, torch.arange(len(data.task))
    asked = model.code_of_sentence(queries(data.sentences[clip, alternative]))
    task = model.understand(asked, data.features[:, 0])
    read = model.read(task, data.features)
    wish, _, _ = model.follow(task, read, data.hand_m)
    joints = trained.scaling.joints_back(data.keys[:, :, data.features.shape[2] :].numpy())
    made = np.zeros((len(clip), STEPS, joints.shape[2]))
    for i, frames in enumerate(data.frames.tolist()):
        for t in range(min(frames, MAX_FRAMES) - 1):
            made[i, t] = inverse.towards(wish[i, t].numpy().astype(float), joints[i, t])
    return made
