"""The models that pages run, by the name of their pack, and for what they can be chosen.

A model beyond the first two is part of the site as soon as its weights are in `data/weights/`.
"""

from __future__ import annotations

from ptae_lite import artefacts

FIRST = {"ptae": "weights/ptae.safetensors",
         "policy": "weights/one_look_policy_seed0.safetensors"}  # fmt: skip
MORE = {
    "watching": "weights/watching_seed0.safetensors",
    "ptae_5": "weights/ptae_labelled_5_seed0.safetensors",
    "ptae_20": "weights/ptae_labelled_20_seed0.safetensors",
}
# What a reader calls the policies of chapter 06. The first acts where none is chosen.
POLICIES = {
    "watching": "the watching policy",
    "policy": "the one-look policy",
    "ptae": "PTAE of chapter 03",
}
TO_ACT, TO_DESCRIBE = ("start", "step"), ("say",)  # parts of a PTAE, see `networks`
LABELLED = {"ptae_5": 5, "ptae_20": 20, "ptae": 100}  # percent of the training clips


def shipped() -> dict[str, str]:
    """The packs of models in this site, and their weights."""
    stored = artefacts.manifest()
    return FIRST | {name: path for name, path in MORE.items() if path in stored}


def unused(name: str) -> set[str]:
    """The parts that the site does not need of a model."""
    of = {TO_ACT: POLICIES, TO_DESCRIBE: LABELLED}
    return {part for parts, where in of.items() if name not in where for part in parts}


def choices() -> dict[str, dict]:
    """What a page offers: policies with their names, and shares of labels, both by pack."""
    there = shipped()
    of = {"policies": POLICIES, "labelled": LABELLED}
    return {kind: {name: said for name, said in every.items() if name in there}
            for kind, every in of.items()}  # fmt: skip
