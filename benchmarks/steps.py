"""How fast a model trains: a step against the readable form and against plain products."""

from __future__ import annotations

import statistics
import time
from dataclasses import replace
from functools import partial
from itertools import islice

import numpy as np
import torch
from rows import Row, clocked

FLOOR_GFLOP = 0.21  # of a PTAE's step, a sample: both passes through matrices, written plainly
SIZE, PRODUCTS = 512, 20
STEPS, WARM_UP = 12, 3
SHORT_EPOCHS = 40  # of the training that is to describe everything


def product_rate() -> float:
    """GFLOP/s of float32 matrix products here and now, one thread."""
    a, b = torch.randn(SIZE, SIZE), torch.randn(SIZE, SIZE)
    seconds = [clocked(lambda: a @ b) for _ in range(PRODUCTS)]
    return 2 * SIZE**3 / statistics.median(seconds) / 1e9


def some_batches(samples, model: str):
    """Batches as training builds them, and the same with every step of held poses."""
    from ptae_lite.data.batches import epoch_batches
    from ptae_lite.data.scaling import fit_scaling, prepare
    from ptae_lite.data.signals import STEPS as MAX_STEPS
    from ptae_lite.data.signals import Source, build
    from ptae_lite.models import MODELS

    recipe, train = MODELS[model].recipe, samples.split("train")
    source = Source(prepare(samples, fit_scaling(samples, train)))
    rng = np.random.default_rng(0)
    epoch = epoch_batches(rng, train, None, recipe, MODELS[model].config().mix.regular)
    for part, signals in islice(epoch, WARM_UP + STEPS):
        words = torch.from_numpy(rng.integers(0, 8, len(part)))
        yield tuple(
            build(source, torch.from_numpy(part), signals, words, hold_steps)
            for hold_steps in (recipe.hold_steps, MAX_STEPS)
        )


def steps(options) -> list[Row]:
    """Each model's step, as training takes it and in the readable form, in turn."""
    from ptae_lite.data.samples import load_samples
    from ptae_lite.models import MODELS
    from ptae_lite.models.common import losses
    from ptae_lite.optimisers import Optimiser

    samples, rows = load_samples(), []
    for name in ("ptae", "pgae"):
        make, config, _ = MODELS[name]
        model = make(config(features=samples.features.shape[2]))
        optimiser = Optimiser(model, MODELS[name].recipe, steps=2 * (STEPS + WARM_UP))

        def quick(batch, model=model):
            return model.loss(batch)

        def plain(batch, model=model):
            return losses(model(batch), batch, model.word_weights)

        def step(loss, batch, optimiser=optimiser):
            optimiser.step(sum(loss(batch)))

        ratios, shares = [], []
        for short, whole in some_batches(samples, name):
            seconds = clocked(partial(step, quick, short))
            ratios.append(clocked(partial(step, plain, whole)) / seconds)
            floor = FLOOR_GFLOP * len(short.frames) / product_rate()
            shares.append(100 * floor / seconds)
        how = f"median of {STEPS} pairs, batches of {MODELS[name].recipe.batch}"
        found = {f"{name.upper()}, readable step over the fast one": (1.2, "times", ratios)}
        if name == "ptae":
            found["PTAE, plain arithmetic of a step at the product rate"] = (60, "%", shares)
        for measure, (limit, unit, values) in found.items():
            values = values[WARM_UP:]
            rows.append(Row(measure, limit, unit, statistics.median(values), how, False,
                            min(values), max(values)))  # fmt: skip
    return rows


class Reached(Exception):
    """The level is reached; the rest of the training is not needed."""


def describing(options) -> list[Row]:
    """Short trainings on `fit`: seconds until PTAE describes all of `held_out` right.

    On our recording, and on the authors' data if their folder is given.
    """
    rows = [described("recording", "PTAE describes all held-out samples after")]
    if options.authors:
        rows.append(described(options.authors, "the same on the authors' data"))
    return rows


def described(data, name: str) -> Row:
    """The row of one data set."""
    from ptae_lite import training
    from ptae_lite.data.samples import load_samples
    from ptae_lite.data.signals import Source
    from ptae_lite.evaluation import correct, respond
    from ptae_lite.models import MODELS

    samples, looking = load_samples(data), []
    held_out = samples.split("held_out")
    recipe = replace(MODELS["ptae"].recipe, epochs=SHORT_EPOCHS)

    def all_right(trained) -> bool:
        answer = respond(trained, Source(trained.dataset(samples)), held_out, "describe")
        return bool(correct(answer, samples, held_out).all())

    def look(epoch, trained):
        if epoch % 2 == 0:
            begun = time.perf_counter()
            done = all_right(trained)
            looking.append(time.perf_counter() - begun)
            if done:
                raise Reached(epoch)

    row, begun = Row(name, 60, "s"), time.perf_counter()
    try:
        training.train(samples, recipe, split="fit", on_epoch=look)
        row.how = f"not reached in {SHORT_EPOCHS} epochs"
    except Reached as reached:
        row.value = time.perf_counter() - begun - sum(looking)
        row.how = f"measured, 1 thread, epoch {reached} of {SHORT_EPOCHS}"
    return row
