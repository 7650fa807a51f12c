"""The models that pages run, by the name of their pack, and for what they can be chosen.

A model beyond the first two is part of the site as soon as its weights are in `data/weights/`.
"""

from __future__ import annotations

from ptae_lite import artefacts

FIRST = {"ptae": "weights/ptae.safetensors",
         "policy": "weights/one_look_policy_seed0.safetensors"}  # fmt: skip
MORE = {
    "no_padding": "weights/ptae_no_padding_seed0.safetensors",
    "watching": "weights/watching_policy_seed0.safetensors",
    "dagger": "weights/dagger_seed0.safetensors",
    "ptae_5": "weights/ptae_labelled_5_seed0.safetensors",
    "ptae_20": "weights/ptae_labelled_20_seed0.safetensors",
}
# What a reader calls the policies of chapter 06. The first acts where none is chosen.
POLICIES = {
    "policy": "the one-look policy",
    "ptae": "PTAE as the paper trains it",
    "no_padding": "PTAE, frozen video, no padding",
    "watching": "the watching policy",
    "dagger": "the watching policy after DAgger",
}
TO_DESCRIBE = ("encode", "say")  # the parts of a model that does not act, see `networks`
LABELLED = {"ptae_5": 5, "ptae_20": 20, "ptae": 100}  # percent of the training clips


def shipped() -> dict[str, str]:
    """The packs of models in this site, and their weights."""
    stored = artefacts.manifest()
    return FIRST | {name: path for name, path in MORE.items() if path in stored}


def choices() -> dict[str, dict]:
    """What a page offers: policies with their names, and shares of labels, both by pack."""
    there = shipped()
    of = {"policies": POLICIES, "labelled": LABELLED}
    return {kind: {name: said for name, said in every.items() if name in there}
            for kind, every in of.items()}  # fmt: skip
