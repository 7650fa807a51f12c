"""The facts of the data sheet, counted in the stored recording and read from the manifest."""

from __future__ import annotations

import numpy as np

from ptae_lite import artefacts, language
from ptae_lite.book.outcomes import table
from ptae_lite.data import frames
from ptae_lite.data.samples import Samples, load_samples

RECORDING = "recording/"


def facts() -> dict[str, str]:
    """What can be counted in the recording, each with its name."""
    samples = load_samples("recording")
    train, test = samples.split("train"), samples.split("test")
    lengths, each = np.unique(samples.frames, return_counts=True)
    images = frames.stored_keys()
    high, wide, _ = frames.frame(*images[0]).shape
    shown = language.patterns()
    tracks, both = _movements(samples), _movements(samples, train) & _movements(samples, test)
    return {
        "samples": f"{len(samples.frames)}: {len(train)} for training, {len(test)} for the test",
        "patterns": f"{len(shown)}, each in {samples.variation.max() + 1} variations",
        "sentences": f"{len(language.MEANINGS)} meanings, {len(language.VOCABULARY)} words",
        "frames": "; ".join(f"{n} samples with {t}" for t, n in zip(lengths, each, strict=True)),
        "in a frame": f"{samples.joints.shape[2]} joint angles in radians, "
        f"{samples.features.shape[2]} features of the image encoder, pose and touch of both cubes",
        "stored images": f"{len(images):,} of {high} x {wide} pixels",
        "distinct movements": f"{len(tracks)}",
        "movements in both parts": f"{len(both)}",
        "distinct start poses": f"{len(np.unique(samples.joints[:, 0], axis=0))}",
        "missing values": f"{sum(int(np.isnan(a).sum()) for a in (samples.joints, samples.cubes))}",
    }


def _movements(samples: Samples, some=slice(None)) -> set[bytes]:
    return {track.tobytes() for track in samples.joints[some]}


class Facts:
    """The counted facts as a table."""

    def _repr_html_(self) -> str:
        return table(("what", "how many"), list(facts().items()))


class Files:
    """The files of the recording: how each was made, from the manifest."""

    def _repr_html_(self) -> str:
        rows = []
        for name, of in artefacts.manifest().items():
            if name.startswith(RECORDING):
                rows += [("file", name), ("size", f"{of['bytes'] / 1e6:.1f} MB"),
                         ("made by", f"{of['command']}; {made(of)}"),
                         ("SHA-256 begins", of["sha256"][:12])]  # fmt: skip
        return table(("", ""), rows)


def made(entry: dict) -> str:
    """Seed, minutes and versions of an entry of the manifest, in words."""
    seed = "" if entry.get("seed") is None else f"seed {entry['seed']}, "
    versions = ", ".join(f"{name} {v}" for name, v in entry.get("versions", {}).items())
    return f"{seed}{entry['minutes']:g} minutes; {versions}"
