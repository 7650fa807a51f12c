"""How a file of a re-run is compared with the stored one; each check states its tolerance.

Equal bytes always agree. Other machines, recipes or seeds give other bytes. Then a check compares
what the file is used for: the numbers of a table, the scores of a model, the motions of a
recording.
"""

from __future__ import annotations

import io
import re
import zipfile
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd
import torch
from PIL import Image

from ptae_lite import artefacts, vision
from ptae_lite.baselines import linear_describe_accuracy
from ptae_lite.data.samples import load_stored
from ptae_lite.evaluation import evaluate
from ptae_lite.experiments import episodes as kept_episodes
from ptae_lite.models import checkpoint

OTHER_SHAPES = "its arrays have other names or shapes"


class Comparison(NamedTuple):
    """The result of a comparison.

    Args:
        agrees: whether the file agrees within the tolerance.
        says: what was found.
        whole: whether all that is stored was made again and compared.
    """

    agrees: bool
    says: str
    whole: bool = True


class Check(NamedTuple):
    """How a file is compared.

    Args:
        states: the tolerance, in words.
        compare: called as `compare(name, remade, stored)`, with two data folders.
        key: columns that name a row, for a table of which a re-run may make only some rows.
    """

    states: str
    compare: Callable[[str, Path, Path], Comparison]
    key: tuple[str, ...] = ()


def judge(name: str, check: Check, remade: Path, stored: Path) -> Comparison:
    """Compare one file of the two folders. A file that cannot be compared does not agree.

    For a table with a key, `remade` is the folder with the rows that were made; it has no manifest.
    """
    kept = artefacts.stored(name, stored)
    made = remade / name if check.key else artefacts.stored(name, remade)
    try:
        if made.read_bytes() == kept.read_bytes():
            return Comparison(True, "the same bytes")
        return check.compare(name, remade, stored)
    except (ValueError, KeyError, TypeError, OSError, zipfile.BadZipFile) as error:
        return Comparison(False, f"cannot be compared ({error})")


def near(pairs: dict[str, tuple], tolerances: dict[str, tuple[float, float]], share: float = 1.0):
    """Compare numbers.

    Args:
        pairs: name to the arrays (remade, stored).
        tolerances: name to (a, r): a difference of a plus r times the stored number is allowed.
        share: the share of all numbers that must be within it.
    """
    kept, count, furthest, worst = 0, 0, 0.0, ""
    for name, both in pairs.items():
        made, was = (np.asarray(one, dtype=float).ravel() for one in both)
        room = tolerances[name][0] + tolerances[name][1] * np.abs(np.nan_to_num(was))
        off = np.where(np.isnan(made) & np.isnan(was), 0, np.abs(made - was))
        off = np.where(np.isnan(off), np.inf, off)  # NaN in only one of them
        kept, count = kept + int((off <= room).sum()), count + off.size
        excess = off / np.maximum(room, 1e-12)
        if off.size and excess.max() > furthest:
            i = int(excess.argmax())
            furthest, worst = excess[i], f"; furthest: {name} {made[i]:.4g} for {was[i]:.4g}"
    if not count:
        return Comparison(False, "they have nothing in common to compare")
    return Comparison(kept >= share * count, f"{kept} of {count} numbers within{worst}")


def _arrays(path: Path) -> dict[str, np.ndarray]:
    with np.load(path, allow_pickle=False) as file:
        return {name: file[name] for name in file.files}


def _shapes(arrays: dict[str, np.ndarray]) -> dict[str, tuple]:
    return {name: array.shape for name, array in arrays.items()}


def table(key: Iterable[str], within: dict[str, tuple[float, float]], share: float = 0.95) -> Check:
    """A CSV table: compares means over the seeds that both tables have, row by row.

    Args:
        key: columns that name a row.
        within: tolerances, by a regular expression for column names.
        share: the share of all numbers that must be within it.
    """
    key = tuple(key)

    def compare(name: str, remade: Path, stored: Path) -> Comparison:
        made, was = (pd.read_csv(folder / name) for folder in (remade, stored))
        columns = {
            column: next((room for p, room in within.items() if re.search(p, column)), None)
            for column in was if column not in key
        }  # fmt: skip
        columns = {column: room for column, room in columns.items() if room is not None}
        lost = [column for column in (*key, *columns) if column not in made]
        if lost:
            return Comparison(False, f"has no column {lost[0]!r}")
        both = made.merge(was, on=list(key), suffixes=(" made", " was"))
        group = [column for column in key if column != "seed"]
        pairs = {}
        for column in columns:
            mine = both[[f"{column} made", f"{column} was"]].astype(float)
            means = mine.groupby([both[c] for c in group], dropna=False).mean()
            pairs[column] = (means[f"{column} made"], means[f"{column} was"])
        verdict = near(pairs, columns, share)
        count = len(was.merge(both[list(key)].drop_duplicates()))
        says = f"{count} of {len(was)} rows re-made, {verdict.says}"
        return verdict._replace(says=says, whole=count == len(was))

    rooms = ", ".join(f"{column} {_room(*room)}" for column, room in within.items())
    return Check(f"{share:.0%} of its numbers: {rooms}", compare, key)


def _room(absolute: float, relative: float) -> str:
    parts = [f"{absolute:g}"] * bool(absolute) + [f"{relative:.0%}"] * bool(relative)
    return "± " + (" + ".join(parts) or "0")


def arrays(within: dict[str, float], share: float = 0.99) -> Check:
    """An npz file: `share` of each named array must be within a tolerance, and all others equal."""

    def compare(name: str, remade: Path, stored: Path) -> Comparison:
        made, was = (_arrays(folder / name) for folder in (remade, stored))
        if _shapes(made) != _shapes(was):
            return Comparison(False, OTHER_SHAPES)
        for other in was.keys() - within.keys():
            if not np.array_equal(made[other], was[other]):
                return Comparison(False, f"{other} is not the same")
        each = [near({n: (made[n], was[n])}, {n: (room, 0)}, share) for n, room in within.items()]
        return Comparison(all(one.agrees for one in each), "; ".join(one.says for one in each))

    rooms = ", ".join(f"{name} ± {room:g}" for name, room in within.items())
    return Check(f"{share:.0%} of the numbers in each: {rooms}; the rest equal", compare)


def texts(key: Iterable[str], column: str, share: float) -> Check:
    """A CSV table of texts: `share` of the texts in `column` must be the same."""

    def compare(name: str, remade: Path, stored: Path) -> Comparison:
        made, was = (
            pd.read_csv(folder / name, keep_default_na=False).set_index(list(key))[column]
            for folder in (remade, stored)
        )
        if set(made.index) != set(was.index):
            return Comparison(False, "has other rows")
        alike = int((made.reindex(was.index) == was).sum())
        return Comparison(alike >= share * len(was), f"{alike} of {len(was)} {column}s the same")

    return Check(f"{share:.0%} of its {column}s the same", compare)


def _strips(name: str, remade: Path, stored: Path) -> Comparison:
    made, was = (_arrays(folder / name) for folder in (remade, stored))
    if _shapes(made) != _shapes(was):
        return Comparison(False, OTHER_SHAPES)
    videos = [n for n, a in was.items() if a.dtype == np.uint8]
    light = {n: tuple(a[n].mean((-3, -2)) for a in (made, was)) for n in videos}  # of pictures
    return near(light, dict.fromkeys(videos, (10, 0)), 0.9)


def episodes(share: float) -> Check:
    """Stored episodes of the closed loop.

    The sentences must be the same, and `share` of the episodes must succeed or fail as before.
    """

    def compare(name: str, remade: Path, stored: Path) -> Comparison:
        made, was = (kept_episodes.load(folder / name) for folder in (remade, stored))
        if [(one.instruction, one.stage.colours) for one in made] != [
            (one.instruction, one.stage.colours) for one in was
        ]:
            return Comparison(False, "holds other sentences or scenes")
        alike = [m.verdict.success == w.verdict.success for m, w in zip(made, was, strict=True)]
        says = f"{sum(alike)} of {len(alike)} succeed or fail as they did"
        return Comparison(sum(alike) >= share * len(alike), says)

    return Check(f"{share:.0%} of its episodes succeed or fail as they did", compare)


def pictures(levels: float) -> Check:
    """A zip of pictures: the same names, and 99 % of them on average within `levels` of 255."""

    def compare(name: str, remade: Path, stored: Path) -> Comparison:
        with zipfile.ZipFile(remade / name) as made, zipfile.ZipFile(stored / name) as was:
            if made.namelist() != was.namelist():
                return Comparison(False, "holds other pictures")
            off = [np.abs(_pixels(made, p) - _pixels(was, p)).mean() for p in was.namelist()]
        return near({"levels": (off, np.zeros(len(off)))}, {"levels": (levels, 0)}, 0.99)

    return Check(f"99% of its pictures: on average ± {levels:g} of 255 levels", compare)


def _pixels(file: zipfile.ZipFile, name: str) -> np.ndarray:
    return np.asarray(Image.open(io.BytesIO(file.read(name))).convert("RGB"), dtype=float)


def reconstruction(worse: float) -> Check:
    """An encoder: its error on the stored first frames may be at most `worse` (a share) larger."""

    def compare(name: str, remade: Path, stored: Path) -> Comparison:
        from ptae_lite.data import frames

        keys = [key for key in frames.stored_keys() if key[2] == 0][::4]
        images = vision.as_input(frames.images(keys)).split(9)  # drawn at once, they take 250 MB
        errors = []
        with torch.no_grad():
            for folder in (remade, stored):
                encoder = vision.load_autoencoder(folder / name)
                off = [(encoder(some) - some).abs().mean(dim=(1, 2, 3)) for some in images]
                errors.append(float(torch.cat(off).mean()))
        made, was = errors
        return Comparison(made <= was * (1 + worse), f"error of a pixel {made:.4f} for {was:.4f}")

    return Check(f"draws first frames at most {worse:.0%} worse", compare)


def _probe(name: str, remade: Path, stored: Path) -> Comparison:
    scores = []
    for folder in (remade, stored):
        samples = load_stored(folder)
        scores.append(linear_describe_accuracy(samples, samples.split("train")))
    return near({"% read right": ([scores[0]], [scores[1]])}, {"% read right": (5, 0)})


def scores(accuracy: float, nrmse: float) -> Check:
    """A model's scores, each on the features of its own folder.

    Args:
        accuracy: points by which an accuracy may differ.
        nrmse: points by which an NRMSE may differ.
    """

    def compare(name: str, remade: Path, stored: Path) -> Comparison:
        made, was = (
            evaluate(checkpoint.load(folder / name), load_stored(folder))
            for folder in (remade, stored)
        )
        rooms = {score: (accuracy if score.endswith("accuracy") else nrmse, 0) for score in was}
        return near({score: ([made[score]], [was[score]]) for score in was}, rooms)

    return Check(f"accuracies ± {accuracy:g} points, NRMSE ± {nrmse:g} points", compare)


STRIPS = Check(
    "90% of its pictures of the same light, ± 10 levels; the episodes are others", _strips
)
PROBED = Check("the linear baseline reads as many clips right, ± 5 points", _probe)
SCORES = scores(5, 0.5)
