"""A card for each stored model: what it is, how it was trained, what it scores.

All of it comes from the weights, the manifest and the stored tables, so a new training renews it.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass
from html import escape

import pandas as pd

from ptae_lite import artefacts
from ptae_lite.book.data_sheet import made
from ptae_lite.book.outcomes import table
from ptae_lite.errors import ArtefactError

WEIGHTS = "weights/"
SHOWN = {  # columns of the stored tables, as a card names them
    "samples_seen": "images seen, in the table",
    "describe_accuracy": "describes right, %",
    "repeat_language_accuracy": "repeats a sentence right, %",
    "execute_nrmse": "execute, NRMSE in %",
    "repeat_action_nrmse": "repeat action, NRMSE in %",
    "first_both": "both colours read from a first frame, %",
    "last_act": "action read from a last frame, %",
    "joints_r2": "joint angles, R2",
    "success": "does what it was told in the simulator, %",
    "moved": "the same where a cube is moved meanwhile, %",
    "describe_with_clock_accuracy": "describes clips without padding right, %",
}


@dataclass(frozen=True)
class Kind:
    """What models of a kind are, and where their scores stand."""

    title: str
    into: str
    out: str
    scores: Callable[[dict], pd.DataFrame]


def _of_encoder(name: str) -> Callable[[dict], pd.DataFrame]:
    def rows(about: dict) -> pd.DataFrame:
        found, recipe = _table("encoders").query("split == 'test'"), about["recipe"]
        found, seen = found[found["encoder"] == name], recipe["steps"] * recipe["batch"]
        far = (found["samples_seen"] - seen).abs()
        found = found[far == far.min()]
        return found.assign(stored=(found["seed"] == recipe["seed"]) & (far == 0))

    return rows


def _of_model(variant: str) -> Callable[[dict], pd.DataFrame]:
    def rows(about: dict) -> pd.DataFrame:
        found = _table("family").query("data == 'recording'")
        return _stored(found[found["variant"] == variant], about)

    return rows


def _of_policy(about: dict) -> pd.DataFrame:
    found = _table("closed_loop_models").query("model == 'one_look_policy'")
    tries = _table("closed_loop").query("model == 'one_look_policy' and condition == 'test'")
    acted = 100 * tries.groupby("seed")["success"].mean()
    return _stored(found.assign(success=found["seed"].map(acted)), about)


def _of_labelled(share: float) -> Callable[[dict], pd.DataFrame]:
    def rows(about: dict) -> pd.DataFrame:
        found = _table("supervision").query("data == 'recording' and model == 'ptae'")
        return _stored(found[(found["variant"] == "paper") & (found["share"] == share)], about)

    return rows


def _of_watching(about: dict) -> pd.DataFrame:
    found = _table("watching_models").query("model == 'watching' and split == 'test'")
    tries = _table("watching").query("model == 'watching' and split == 'test'")
    acted = 100 * tries.groupby(["condition", "seed"])["success"].mean()
    columns = {name: found["seed"].map(acted[condition])
               for name, condition in (("success", "test"), ("moved", "moved"))}  # fmt: skip
    return _stored(found.assign(**columns), about)


def _stored(rows: pd.DataFrame, about: dict) -> pd.DataFrame:
    """With a column that says which training of the table is the stored one."""
    same = (rows["seed"] == about["recipe"]["seed"]) & (rows["steps"] == about["steps"])
    return rows.assign(stored=same)


CLIP = "a sentence, and a clip as joint angles and image features"
MOTION = "a sentence, and joint angles frame by frame"
CODE = "30 numbers (10 for each colour channel)"
KINDS = {
    "cae": Kind("Image encoder, channel-separated", "a camera image", CODE,
                _of_encoder("separated 3x10")),
    "plain_cae": Kind("Image encoder, plain", "a camera image", "10 numbers",
                      _of_encoder("plain 10")),
    "ptae": Kind("PTAE, the paired transformed autoencoder", CLIP, MOTION, _of_model("PTAE")),
    "ptae_adam": Kind("PTAE, trained with Adam alone", CLIP, MOTION, _of_model("PTAE, Adam")),
    **{f"ptae_labelled_{share}": Kind(f"PTAE with {share} % of the labels", CLIP, MOTION,
                                      _of_labelled(share)) for share in (5, 20)},
    "one_look_policy": Kind("PTAE as a policy that looks once", "a sentence, and the first camera "
                            "image", "joint angles frame by frame", _of_policy),
    "watching": Kind("Policy that watches, on a PTAE", "a sentence, and a camera image and the "
                     "measured joint angles at every frame", "places for the hand, from which "
                     "inverse kinematics makes joint angles; a sentence about its own act",
                     _of_watching),
}  # fmt: skip


def names() -> list[str]:
    """The stored models: the weights in the manifest."""
    return [name for name in artefacts.manifest() if name.startswith(WEIGHTS)]


def kind(name: str) -> Kind:
    """The kind of a stored model.

    Raises:
        ArtefactError: there is none; a new kind of model needs an entry in `KINDS`.
    """
    stem = re.sub(r"_seed\d+$", "", name.removeprefix(WEIGHTS).split(".")[0])
    if stem not in KINDS:
        raise ArtefactError(f"no card for {name}; its kind is missing in model_cards.KINDS.")
    return KINDS[stem]


def card(name: str) -> dict[str, str]:
    """What the card of a stored model says."""
    tensors, about = artefacts.load_weights(artefacts.stored(name))
    entry, of, recipe = artefacts.entry_of(name), kind(name), about.get("recipe") or {}
    sizes = [t.numel() for key, t in tensors.items() if not key.startswith("scaling.")]
    said = {
        "file": f"{name}, {entry['bytes'] / 1e6:.1f} MB",
        "input": of.into,
        "output": of.out,
        "parameters": f"{sum(sizes):,}",
        "made by": f"{entry['command']}; {made(entry)}",
        "recipe": ", ".join(
            f"{field.replace('_', ' ')} {_short(v)}" for field, v in recipe.items()
        ),
    }
    if "labelled" in about:
        said["trained on"] = f"{about['split']} samples, {about['labelled']} with a label"
    return said | scores(of.scores(about))


def scores(rows: pd.DataFrame) -> dict[str, str]:
    """The scores of the stored training, if it is in the table, and the range of all in it."""
    said = {}
    for column, says in SHOWN.items():
        if column in rows and len(rows):
            one = rows.loc[rows["stored"], column]
            low, high, count = rows[column].min(), rows[column].max(), rows["seed"].nunique()
            this = f"{_rounded(one.iloc[0])}; " if len(one) else ""
            said[says] = f"{this}{count} trainings: {_rounded(low)} to {_rounded(high)}"
    return said or {"scores": "not in the stored tables"}


def _table(name: str) -> pd.DataFrame:
    return pd.read_csv(artefacts.stored(f"results/{name}.csv"))


def _rounded(value) -> str:
    return f"{value:,.0f}" if value > 1000 else f"{value:.2f}"


def _short(value) -> str:
    return f"{value:.3g}" if isinstance(value, float) else str(value)


class Cards:
    """The cards of all stored models."""

    def _repr_html_(self) -> str:
        return "".join(
            f"<h3>{escape(kind(name).title)}</h3>{table(('', ''), list(card(name).items()))}"
            for name in names()
        )
