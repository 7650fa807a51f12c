"""One training loop.

Signals are mixed within a batch: every sample draws its own, so a step learns all tasks at once
(ours; the published code has one signal a batch, batches of 6, and 270,000 steps). Only samples
that count as labelled ever take part in a supervised signal.
"""

from __future__ import annotations

from dataclasses import asdict
from math import lcm

import numpy as np
import torch
from jaxtyping import Int
from torch import Tensor, nn

from ptae_lite import devices
from ptae_lite.data.samples import Samples
from ptae_lite.data.scaling import Scaling, fit_scaling, prepare
from ptae_lite.data.signals import PTAE_MIX, Source, blend, build, refilm, signal_number
from ptae_lite.errors import ConfigError
from ptae_lite.models.checkpoint import Trained
from ptae_lite.models.registry import MODELS
from ptae_lite.recipe import Recipe

RECIPES = {name: kind.recipe for name, kind in MODELS.items()}


def draw_signals(
    rng: np.random.Generator, count: int, supervised, groups=PTAE_MIX.regular
) -> Int[Tensor, " B"]:
    """Signal numbers: of the second group with probability `supervised`, else of the first.

    Given for each sample by itself, 0 and 1 say which group it must take.
    """
    width = lcm(*map(len, groups))  # a group fills its row by repeating itself
    rows = [[signal_number(s) for s in group] * (width // len(group)) for group in groups]
    row = (rng.random(count) < supervised).astype(int)
    return torch.from_numpy(np.array(rows)[row, rng.integers(0, width, count)])


def draw_partners(rng: np.random.Generator, signals: Int[Tensor, " B"]):
    """Shares from a half to one, and for each sample of a signal another one of the same."""
    share, partner = rng.uniform(0.5, 1.0, len(signals)), np.arange(len(signals))
    for signal in signals.unique().numpy():
        same = np.flatnonzero(signals.numpy() == signal)
        partner[same] = rng.permutation(same)
    return torch.from_numpy(share.astype(np.float32)), torch.from_numpy(partner)


def draw_films(rng: np.random.Generator, part, films: dict, scaling: Scaling) -> dict[int, Tensor]:
    """For places in the batch `part`: another film than the recorded one, if that is drawn."""
    drawn = {}
    for place, sample in enumerate(part):
        others = films.get(int(sample), ())
        which = rng.integers(0, len(others) + 1)
        if which:
            film = scaling.features(others[which - 1]).astype(np.float32)
            drawn[place] = torch.from_numpy(film)
    return drawn


def epoch_batches(
    rng, train: np.ndarray, labelled: np.ndarray | None, recipe: Recipe, groups=PTAE_MIX.regular
):
    """Yield (samples, signals) of one epoch.

    Where all samples have a label (None), each appears once and draws any signal. Otherwise those
    that have one take signals that need it, and the others take the others. Balanced, half of
    every batch comes from the labelled list, and half from the others in turn. Not balanced, each
    sample appears once, so that as few updates are supervised as samples are labelled.
    """
    if labelled is None or not recipe.balanced:
        order = rng.permutation(train)
        for i in range(0, len(order) - recipe.batch + 1, recipe.batch):
            part = order[i : i + recipe.batch]
            share = recipe.supervised if labelled is None else np.isin(part, labelled)
            yield part, draw_signals(rng, len(part), share, groups)
        return
    unlabelled, taken = rng.permutation(np.setdiff1d(train, labelled)), 0
    for i in range(max(len(train) // recipe.batch, 1)):
        half = (recipe.batch + i % 2) // 2  # an odd batch gives its odd one to each in turn
        mine = rng.choice(labelled, half, replace=len(labelled) < half)
        rest = recipe.batch - half
        others = np.take(unlabelled, np.arange(taken, taken + rest), mode="wrap")
        taken += rest
        signals = [draw_signals(rng, n, share, groups) for n, share in ((half, 1.0), (rest, 0.0))]
        yield np.concatenate([mine, others]), torch.cat(signals)


def label(train: np.ndarray, share_percent: float, seed: int) -> np.ndarray:
    """A fixed list of labelled samples: `share_percent` of `train`, rounded up.

    1 and 2 % of 648 are 7 and 13 samples, as the paper says.
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
    films: dict[int, list[np.ndarray]] | None = None,
    device: str = "cpu",
    on_epoch=lambda epoch, trained: None,
    progress=lambda epochs: epochs,
) -> Trained:
    """Train a model on the samples of a split.

    Args:
        recipe: the model's own in `RECIPES` if None.
        model: `ptae`, `pgae`, `pvae` or `prae`.
        config: its sizes; the paper's if None.
        split: `train` for the final model; `fit` while settings are chosen on `held_out`.
        labelled: sample numbers that supervised signals may use; all if None. PVAE and PRAE bind
            these samples' halves, and no others'.
        limited: every sample has a label, but few updates use one (`recipe.supervised`); signals
            are drawn as where few samples have a label, so PGAE's repeat both counts as supervised.
        films: of some samples (by their numbers), what was seen when their sentence was executed
            otherwise than recorded: features (99, F) before scaling. Execute is then trained with
            one of a sample's films, the recorded one among them, each as likely.
        device: where the arithmetic is done, such as `cuda`. Batches are drawn on the CPU, so that
            a seed draws the same everywhere; the model comes back to the CPU.
        on_epoch: called after each epoch with its number (from 1) and the model so far.
        progress: wraps the iterator over epochs (as `tqdm` does).

    What comes out carries, as `about["history"]`, the mean of each of the model's costs in each
    epoch: language, action, and in PVAE and PRAE what binds the two halves; and as
    `about["supervised_presentations"]` how often a sample was shown where its label counted.

    Raises:
        ConfigError: no such model, sizes of another one, no such device here, samples that do not
            fill a batch, labelled samples from outside the split.
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
    mix = config.mix.limited if limited or labelled is not None else config.mix.regular
    need_label = np.array([signal_number(signal) for signal in config.mix.limited[1]])
    with_label = indices if labelled is None else labelled
    strangers = indices if labelled is None else np.setdiff1d(indices, labelled)
    torch.manual_seed(recipe.seed)
    rng = np.random.default_rng(recipe.seed)
    scaling = fit_scaling(samples, indices, recipe.exponent)
    source = Source(prepare(samples, scaling))
    network: nn.Module = kind.network(config).to(device)
    paces = (1.0, recipe.action_pace)
    mine = list(network.action.parameters())
    groups = ([p for p in network.parameters() if not any(p is q for q in mine)], mine)
    optimiser = torch.optim.Adam(({"params": list(group)} for group in groups), fused=True)
    steps = recipe.epochs * len(list(epoch_batches(rng, indices, labelled, recipe, mix)))
    if not steps:
        raise ConfigError(f"{len(indices)} samples do not fill a batch of {recipe.batch}")
    schedule = torch.optim.lr_scheduler.OneCycleLR(
        optimiser, [recipe.learning_rate * pace for pace in paces], total_steps=steps
    )
    weights = (recipe.language_weight, recipe.action_weight, 1.0)
    history = []
    about = {
        "eye": samples.eye,
        "recipe": asdict(recipe),
        "split": split,
        "holdout": samples.holdout,
        "labelled": len(with_label),
        "steps": steps,
        "supervised_presentations": 0,
        "history": history,
    }
    trained = Trained(network, scaling, about)
    for epoch in progress(range(1, recipe.epochs + 1)):
        network.train()
        sums = 0.0
        batches = list(epoch_batches(rng, indices, labelled, recipe, mix))
        for part, signals in batches:
            alternative = torch.from_numpy(rng.integers(0, 8, len(part)))
            extra = torch.from_numpy(rng.random(len(part)) < recipe.extra) if recipe.extra else None
            told = _told(rng, part, signals, strangers) if recipe.unpaired else part
            parts = (torch.from_numpy(part), signals, alternative, recipe.hold, extra)
            batch = build(source, *parts, torch.from_numpy(told))
            paired = np.isin(part, with_label)
            about["supervised_presentations"] += int((np.isin(signals, need_label) & paired).sum())
            if films:
                batch = refilm(batch, draw_films(rng, part, films, scaling))
            if recipe.mixup:
                batch = blend(batch, *draw_partners(rng, signals))
            with torch.device(device):  # what a model makes itself belongs there, too
                costs = network.costs(batch.to(device), torch.from_numpy(paired).to(device))
            optimiser.zero_grad()
            sum(w * cost for w, cost in zip(weights, costs, strict=False)).backward()
            nn.utils.clip_grad_norm_(network.parameters(), recipe.clip)
            optimiser.step()
            schedule.step()
            sums += np.array([cost.item() for cost in costs])
        history.append([round(x, 5) for x in (sums / len(batches)).tolist()])
        network.eval()
        on_epoch(epoch, trained)
    network.to("cpu").eval()
    return trained


def _told(rng, part: np.ndarray, signals: Tensor, strangers: np.ndarray) -> np.ndarray:
    """Whose sentence each sample is given: its own, but to repeat language any of `strangers`."""
    repeats = signals.numpy() == signal_number("repeat language")
    return np.where(repeats, rng.choice(strangers, len(part)), part)
