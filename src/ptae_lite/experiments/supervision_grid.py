"""The trainings of the study of limited supervision: models, experiments, shares and seeds.

See `experiments.supervision` for the two experiments, and for what becomes of a training.
"""

from __future__ import annotations

from typing import NamedTuple

from ptae_lite.errors import ConfigError
from ptae_lite.models import ADAM

SHARES = {  # percent: of the 648 training samples, and of the updates
    "samples": (1, 2, 5, 10, 20, 50, 66.6, 100),
    "iterations": (1, 2, 10, 20, 50, 66.6),
}
REGULAR = {"samples": 100, "iterations": 66.6}  # one training, with all labels
ORDER = (10, 2, 50, 20, 5, 1, 66.6, 100)  # so that a stopped study already covers the range
DRAWS = 20  # of labels for the linear baseline, which takes no time
SEEDS = (0, 1, 2)


class Variant(NamedTuple):
    """How labelled samples are used.

    Args:
        recipe: settings of the recipe to change.
        times: factor on the number of epochs.
    """

    recipe: dict = {}
    times: int = 1  # as many epochs


VARIANTS = {
    # each sample once an epoch, as in the paper: the share of updates is the share of samples
    "paper": Variant(),
    "balanced": Variant({"balanced": True}),  # half of every batch has a label
    # a sentence to repeat comes with the scene of another sample
    "shuffled-scenes": Variant({"shuffle_scenes": True}),
    "covering": Variant(),  # the labelled samples name every word
    "pseudo-labels": Variant(),  # the others have a label that was found, see `pseudo_labels`
    "long": Variant(times=8),
    "paper-length": Variant(times=31),  # as many samples shown as in the paper's training of PTAE
    # with Adam alone: it describes more where labels come seldom (`recipes`)
    "adam": Variant(ADAM["ptae"]),
    "adam-long": Variant(ADAM["ptae"], times=8),
    "adam-paper-length": Variant(ADAM["ptae"], times=31),
}
DRAWN = {"covering": "covering", "pseudo-labels": "pseudo"}  # else random


class Job(NamedTuple):
    """One row to make. The regular training stands in two rows.

    Args:
        model: `ptae`, `pgae`, `pvae` or `linear`.
        mode: `samples` or `iterations`.
        variant: a name in `VARIANTS`; for `linear`, how its labels are drawn.
        share: percent of the samples, or of the updates.
    """

    model: str
    mode: str
    variant: str
    share: float
    seed: int

    @property
    def regular(self) -> bool:
        """Whether all labels are used as often as in chapter 03. Variants are then the same."""
        return self.share == REGULAR[self.mode]


def grid(seeds=None, core: bool = False) -> list[Job]:
    """Every job of the study, in order.

    First comes the linear baseline, which takes no time, with all its draws. Then come, seed by
    seed, the trainings that the curves need, then the variants.

    Args:
        core: leave out the variants.
    """
    found = [
        Job("linear", "samples", variant, share, seed)
        for variant in ("random", "covering", "pseudo-labels") for share in SHARES["samples"][:-1]
        for seed in range(DRAWS)
    ]  # fmt: skip
    found += [Job("linear", "samples", "random", 100, 0)]  # all labels can be drawn in one way only

    def more(model, mode, variant, seed, *shares):
        found.extend(Job(model, mode, variant, s, seed) for s in ORDER if s in shares)

    seeds = seeds or SEEDS
    for seed in seeds:
        for model in ("ptae", "pgae"):
            more(model, "samples", "paper", seed, *SHARES["samples"])
            more(model, "iterations", "paper", seed, *SHARES["iterations"])
        more("pvae", "samples", "paper", seed, 2, 10, 20, 50, 100)
    for seed in () if core else seeds:
        for model in ("ptae", "pgae"):
            more(model, "samples", "balanced", seed, *SHARES["samples"])
        more("pvae", "samples", "balanced", seed, 2, 10, 20, 50)
        more("ptae", "samples", "covering", seed, 2)
        more("ptae", "samples", "shuffled-scenes", seed, 10, 50)
        more("ptae", "samples", "pseudo-labels", seed, 10)
        more("ptae", "iterations", "adam", seed, 1, 2, 10)
    if not core:
        for model in ("ptae", "pgae"):
            more(model, "iterations", "long", seeds[0], 2)  # half an hour of a core for each model
        more("ptae", "iterations", "adam-long", seeds[0], 1, 2, 10)  # and for each of these
        # an hour and a half each
        more("ptae", "iterations", "paper-length", seeds[0], 1)
        more("ptae", "iterations", "adam-paper-length", seeds[0], 1)
    return list(dict.fromkeys(map(_once, found)))


def _once(job: Job) -> Job:
    """The job; all forms of the regular training become one."""
    if job.model == "linear" or not job.regular:
        return job
    return job._replace(mode="samples", variant="paper", share=REGULAR["samples"])


def as_rows(job: Job) -> list[Job]:
    """The rows of a job: the regular training has two, except that of PVAE."""
    if not job.regular or job.model in ("linear", "pvae"):
        return [job]
    return [job, job._replace(mode="iterations", share=REGULAR["iterations"])]


def select(jobs: list[Job], **asked) -> list[Job]:
    """The jobs that have, in each of these fields, one of the given values (None: any value).

    Raises:
        ConfigError: no job has such a value, or no job has all of them together.
    """
    named = [(job, name) for job in jobs for name in as_rows(job)]
    for field, values in asked.items():
        there = sorted({getattr(name, field) for _, name in named})
        for value in values or ():
            if value not in there:
                raise ConfigError(f"no {field} {value!r}; there are {', '.join(map(str, there))}")
    found = [
        job for job, name in named
        if all(values is None or getattr(name, field) in values for field, values in asked.items())
    ]  # fmt: skip
    if not found:
        chosen = ", ".join(f"{field} {' '.join(map(str, v))}" for field, v in asked.items() if v)
        raise ConfigError(f"no training is of {chosen} together; leave one of them out")
    return list(dict.fromkeys(found))
