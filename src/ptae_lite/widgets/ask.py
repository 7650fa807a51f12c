"""Panels that ask a model in a notebook's kernel, as live parts do in the site's page."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pandas as pd
import torch
from torch import nn

from ptae_lite import evaluation, vision
from ptae_lite.data import frames
from ptae_lite.data.samples import MAX_FRAMES, Samples
from ptae_lite.data.signals import PTAE_SIGNALS, WIRING, Batch, Source, build, signal_number
from ptae_lite.errors import RobotError
from ptae_lite.language import COLOURS, pattern, patterns, sentence
from ptae_lite.models.checkpoint import Trained
from ptae_lite.plots import transformer as plots
from ptae_lite.plots.vision import squeezed
from ptae_lite.robot import closed_loop
from ptae_lite.robot.motions import VARIATIONS
from ptae_lite.robot.scene import Scene, pybullet
from ptae_lite.widgets import sentences
from ptae_lite.widgets.panels import Panel
from ptae_lite.widgets.supervision import Card

PICTURES = 5  # of a clip
ZEROS, NOTHING, LAST = "zeros, as in training", "nothing: the keys end there", "its last frame"
ORDERS = {  # which frames the keys show, of n
    "as recorded": np.arange,
    "its first half": lambda n: np.arange(n // 2),
    "every other frame": lambda n: np.arange(0, n, 2),
    "shuffled": lambda n: np.random.default_rng(1).permutation(n),
    "frozen at its first frame": lambda n: np.zeros(n, dtype=int),
}
SAME = "as recorded"


def clips() -> dict[str, int]:
    """A clip of each pattern, its first one: what it shows, and its sample number."""
    return {
        f"{sentence(one.meaning)}, {one.left} left, {one.right} right"
        + (", test" if one.split == "test" else ""): one.index * VARIATIONS
        for one in patterns()
    }


def with_keys(batch: Batch, order, after: str) -> Batch:
    """A batch of one clip with other frames in its keys.

    Args:
        order: numbers of the frames.
        after: what follows them: `ZEROS`, `NOTHING` or `LAST`.
    """
    keys = batch.keys[:, torch.as_tensor(order)]
    rest = {NOTHING: keys[:, :0], ZEROS: torch.zeros_like(keys[:, :1]), LAST: keys[:, -1:]}[after]
    missing = MAX_FRAMES - len(order) if after != NOTHING else 0
    keys = torch.cat([keys, *[rest] * missing], dim=1)
    return replace(batch, keys=keys, frames=torch.tensor([len(order)]))


def attention(trained: Trained, encoder: nn.Module, samples: Samples) -> Panel:
    """What a PTAE attends to and answers: any clip, with other frames in the keys.

    The tasks are those whose keys are a moving clip.

    Args:
        encoder: makes the pictures of the keys from their features.
    """
    source, known = Source(trained.dataset(samples)), clips()
    tasks = [name for name in PTAE_SIGNALS if WIRING[name].keys == "clip"]

    def show(task: str, clip: str, frames: str, after_them: str) -> Card:
        index = known[clip]
        one, which = torch.tensor([index]), evaluation.alternatives_for(len(samples.frames))
        batch = build(source, one, torch.tensor([signal_number(task)]), which[one])
        order = ORDERS[frames](int(samples.frames[index]))
        batch = with_keys(batch, order, after_them)
        with torch.no_grad():
            answer = trained.model(batch)
        tokens = [task, "end"]
        seen = order[np.linspace(0, len(order) - 1, PICTURES).round().astype(int)]
        figure = plots.clip_attention(
            answer.attention[0].numpy()[:, : len(tokens)], tokens, len(order),
            dict(enumerate(decoded(encoder, samples.features[index, seen]))), after_them,
        )  # fmt: skip
        if WIRING[task].words == "sentence":
            right = "right" if evaluation.correct(answer, samples, [index])[0] else "wrong"
            return Card(
                figure, f"It says: {evaluation.sentences(answer)[0]}. That is {right}.", None
            )
        made = evaluation.poses(answer, trained.scaling)
        wrong, _ = evaluation.nrmse(made, samples, [index], trained.scaling)
        return Card(figure, f"Its motion is {wrong:.1f} % off (NRMSE).", None)

    return Panel(
        show, {"task": tasks, "clip": list(known), "frames": list(ORDERS),
               "after_them": [ZEROS, NOTHING, LAST]},
        "What PTAE attends to", labels={"frames": "frames in the keys"},
        describe=lambda **values: show(**values).text,
    )  # fmt: skip


def labelled(models: Mapping[float, Trained], samples: Samples) -> Panel:
    """What models say of any clip, side by side.

    Args:
        models: by the share of the labels that they were trained with, in percent.
    """
    known = clips()

    def show(clip: str):
        index = known[clip]
        said = [
            evaluation.sentences(
                evaluation.respond(one, Source(one.dataset(samples)), [index], "describe")
            )[0]
            for one in models.values()
        ]
        truth = sentence(pattern(index // VARIATIONS).meaning)
        return sentences.table(pd.DataFrame({"share": list(models), "said": said, "truth": truth}),
                               list(models))  # fmt: skip

    return Panel(show, list(known), "clip", describe=lambda clip: f"What the models say of: {clip}")


def reconstructed(encoder: nn.Module, samples: Samples) -> Panel:
    """What thirty numbers keep of a scene: as recorded, and with other colours or numbers.

    Without PyBullet the cubes keep their colours.
    """
    known = clips()
    spread = samples.features[:, 0].std(axis=0)
    numbers = ["none", *range(1, len(spread) + 1)]
    try:
        pybullet()
        colours = {"left_cube": [SAME, *COLOURS], "right_cube": [SAME, *COLOURS]}
    except RobotError:
        colours = {"left_cube": [SAME], "right_cube": [SAME]}

    def show(scene: str, left_cube: str, right_cube: str, number, by: float):
        shown, variation = divmod(known[scene], VARIATIONS)
        images = [frames.frame(shown, variation, 0)] * 2
        stage = closed_loop.stage_of(pattern(shown), variation)
        named = tuple(
            old if new == SAME else new
            for old, new in zip(stage.colours, (left_cube, right_cube), strict=True)
        )
        if named != stage.colours:
            with Scene(*stage._replace(colours=named)) as world:
                images[1] = world.image()
        codes = vision.encode_images(encoder, np.stack(images))
        if number != "none":
            codes[1, number - 1] += by * spread[number - 1]
        return squeezed(images, codes, decoded(encoder, codes), ("camera", "30 numbers", "decoder"))

    return Panel(
        show, {"scene": list(known)} | colours | {"number": numbers, "by": list(range(-3, 4))},
        "Left: as recorded. Right: as you change it.", start={"by": 2},
        labels={"number": "number to move", "by": "by how many standard deviations"},
    )  # fmt: skip


@torch.no_grad()
def decoded(encoder: nn.Module, features) -> list[np.ndarray]:
    """Images that an autoencoder's decoder makes of features, (120, 160, 3) each."""
    features = torch.as_tensor(np.asarray(features), dtype=torch.float32)
    return list(vision.as_images(encoder.decode(features)))
