"""The training loop, one for all models."""

from __future__ import annotations

from dataclasses import asdict, replace

import numpy as np

from ptae_lite import devices
from ptae_lite.data.batches import Batches
from ptae_lite.data.samples import Samples
from ptae_lite.data.scaling import fit_scaling
from ptae_lite.errors import ConfigError, TrainingError
from ptae_lite.models.checkpoint import Trained, TrainingRecord
from ptae_lite.models.registry import MODELS
from ptae_lite.optimisers import Optimiser
from ptae_lite.recipe import Recipe
from ptae_lite.unfinished import Unfinished


def label(train: np.ndarray, share_percent: float, seed: int) -> np.ndarray:
    """Draw the labelled samples: `share_percent` % of `train`, rounded up, sorted.

    1 and 2 % of 648 are 7 and 13 samples, the numbers in the paper.

    Raises:
        ConfigError: the share is not above 0 and at most 100.
    """
    if not 0 < share_percent <= 100:
        raise ConfigError(f"a share of {share_percent} % does not exist; it is above 0 to 100")
    count = int(np.ceil(round(share_percent / 100 * len(train), 6)))
    return np.sort(np.random.default_rng([7, seed]).choice(train, count, replace=False))


def train(
    samples: Samples,
    recipe: Recipe | None = None,
    *,
    model: str = "ptae",
    config=None,
    split: str = "train",
    labelled: np.ndarray | None = None,
    limited: bool = False,
    videos: dict[int, list[np.ndarray]] | None = None,
    device: str = "cpu",
    unfinished=None,
    on_epoch=lambda epoch, trained: None,
    progress=lambda epochs: epochs,
) -> Trained:
    """Train a model on the samples of a split.

    Args:
        recipe: how to train; None for the model's own in `MODELS`.
        model: a name in `MODELS`.
        config: the model's configuration; None for the paper's sizes.
        split: `train` for a final model; `fit` if settings are chosen on `held_out`.
        labelled: numbers of the samples that supervised signals may use; None for all. PVAE and
            PRAE bind the two codes of these samples only.
        limited: every sample has a label, but few updates use one (`recipe.supervised`). Signals
            are then drawn as with few labelled samples: PGAE's *repeat both* counts as supervised.
        videos: other videos of a sample, by sample number: features (99, F) before scaling. They
            show its sentence executed in another way than recorded. *Execute* is trained with the
            recorded video or one of these, each equally likely.
        device: where the network computes, such as `cuda`. The result comes back on the CPU.
        unfinished: a file that keeps the state of the training every ten minutes. If it is there,
            the training goes on from it, to the same weights. The caller deletes it when the
            trained model is stored.
        on_epoch: called after each epoch with its number (from 1) and the model so far. What it
            returns, unless None, is kept in the record as `watched`; its time does not count.
        progress: wraps the iterator over epochs, as `tqdm` does.

    Returns:
        The model with its scaling, and its `TrainingRecord` as `about`.

    Raises:
        ConfigError: there is no such model, the configuration is another model's, the device cannot
            be used, the samples do not fill one batch, or a labelled sample is outside the split.
        TrainingError: a loss is no number any more.
        ArtefactError: `unfinished` is the state of another training.
    """
    devices.check(device)
    if model not in MODELS:
        raise ConfigError(f"no model {model!r}; there are {', '.join(MODELS)}")
    kind = MODELS[model]
    if config is not None and type(config) is not kind.config:
        raise ConfigError(f"{model} needs a {kind.config.__name__}, not a {type(config).__name__}")
    recipe = recipe or kind.recipe
    config = config or kind.config(features=samples.features.shape[2])
    indices = samples.split(split)
    if labelled is not None and len(np.setdiff1d(labelled, indices)):
        raise ConfigError(f"labelled samples must belong to the split {split!r}")
    if labelled is not None and len(labelled) == len(indices):
        labelled = None
    groups = config.mix.limited if limited or labelled is not None else config.mix.regular
    scaling = fit_scaling(samples, indices, recipe.exponent)
    batches = Batches(
        samples, scaling, indices, labelled, recipe, groups, config.mix.limited[1], videos
    )
    record = TrainingRecord(
        encoder=samples.encoder, recipe=asdict(recipe), split=split, holdout=samples.holdout,
        labelled=len(batches.with_label), steps=recipe.epochs * batches.count,
    )  # fmt: skip
    weights = (recipe.language_weight, recipe.action_weight, 1.0)  # the third binds PVAE's codes
    with devices.seeded(recipe.seed, device), devices.whole_float32():
        network = kind.network(config).to(device)
        if not batches.count:  # after making the model: its error messages are more helpful
            raise ConfigError(f"{len(indices)} samples do not fill a batch of {recipe.batch}")
        optimiser = Optimiser(network, recipe, record.steps)
        what = asdict(record) | {
            "model": model, "config": asdict(config), "data": samples.fingerprint,
            "labels": batches.with_label.tolist(), "limited": limited,
            "videos": {str(i): [float(v.sum()) for v in own] for i, own in (videos or {}).items()},
        }  # fmt: skip
        state = Unfinished(unfinished, what)
        done, so_far = state.load(network, optimiser, batches.rng)
        record = replace(record, **so_far)
        for epoch in progress(range(done + 1, recipe.epochs + 1)):
            network.train()
            begun, sums, supervised = devices.clock(device), 0.0, 0
            for step, batch in enumerate(batches.epoch(), 1):
                losses = network.loss(batch.inputs.to(device), batch.paired.to(device))
                optimiser.step(sum(w * loss for w, loss in zip(weights, losses, strict=False)))
                values = np.array([loss.item() for loss in losses])
                check_finite(values, (epoch - 1) * batches.count + step, recipe)
                sums += values
                supervised += batch.supervised
            seconds = devices.clock(device) - begun
            record = record.after_epoch(sums / batches.count, supervised, seconds)
            network.eval()
            record = record.with_watched(on_epoch(epoch, Trained(network, scaling, asdict(record))))
            state.save(epoch, network, optimiser, asdict(record), batches.rng)
    return Trained(network.to("cpu").eval(), scaling, asdict(record))


def check_finite(losses: np.ndarray, step: int, recipe: Recipe) -> None:
    """Raise `TrainingError` if a loss of an update is not a number."""
    if not np.isfinite(losses).all():
        raise TrainingError(
            f"the training with seed {recipe.seed} broke off: at update {step} a loss was no "
            "number any more; train it with a lower learning rate"
        )
