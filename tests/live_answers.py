"""What PyTorch answers, as a pack for a page that compares its own answers with them.

`python live_answers.py FOLDER NAMES` writes it, and the networks of the changes with these names.
It is a process of its own: annotations that are checked would be in an exporter's way.
"""

import json
import sys
from pathlib import Path

import numpy as np
import torch
from torch import nn

from ptae_lite import artefacts, evaluation, vision
from ptae_lite.data import frames
from ptae_lite.data.samples import load_samples
from ptae_lite.data.signals import Source
from ptae_lite.experiments.incongruence import (
    EXTRA_INPUT,
    conditions,
    extra_inputs,
    respond_under,
)
from ptae_lite.language import pattern, sentence
from ptae_lite.live import export, files, models, networks, packing
from ptae_lite.models import checkpoint
from ptae_lite.watching_actor import WatchingActor

IMAGES, CONFLICT_CLIPS, WATCHED = 12, 3, 12
JUMP = 15  # the frame from which a policy that watches is shown another clip


def numbers(array, kind="<f4") -> bytes:
    return np.ascontiguousarray(array).astype(kind).tobytes()


def write(folder) -> dict:
    """Write the pack "answers": test clips and all answers to them."""
    torch.set_num_threads(1)
    samples = load_samples("recording")
    test = samples.split("test")
    wording = evaluation.alternatives_for(len(samples.frames))
    parts = {
        name: numbers(
            np.concatenate([getattr(samples, name)[i, : samples.frames[i]] for i in test])
        )
        for name in ("features", "joints")
    }
    told = {"frames": samples.frames[test].tolist(),
            "sentences": [sentence(pattern(int(samples.pattern[i])).meaning, int(wording[i]))
                          for i in test]}  # fmt: skip
    for name, path in models.FIRST.items():
        trained = checkpoint.load(artefacts.stored(path))
        source = Source(trained.dataset(samples))
        executed = evaluation.respond(trained, source, test, "execute")
        parts[f"{name}_execute"] = numbers(executed.joints)
        parts[f"{name}_code"] = numbers(executed.code)
        if name == "ptae":
            described = evaluation.respond(trained, source, test, "describe")
            parts["words"] = numbers(described.words.exp())
            parts["attention"] = numbers(described.attention[:, :, :2])
            told["said"] = evaluation.sentences(described)
            told["labelled"] = {"ptae": told["said"]}
            told["conflicts"], answers = conflicts(trained, samples, source, test, wording)
            parts |= {f"conflict_{key}": numbers(rows) for key, rows in answers.items()}
    for name in models.choices()["labelled"].keys() - {"ptae"}:
        trained = checkpoint.load(artefacts.stored(models.MORE[name]))
        described = evaluation.respond(trained, Source(trained.dataset(samples)), test, "describe")
        told["labelled"][name] = evaluation.sentences(described)
    told["watched"], answers = watched(samples, test, told["sentences"])
    parts |= {f"watching_{key}": numbers(rows) for key, rows in answers.items()}
    encoder = vision.load_autoencoder(artefacts.stored(files.ENCODER))
    shots = np.stack([frames.frame(int(samples.pattern[i]), int(samples.variation[i]), 0)
                      for i in test[:IMAGES]])  # fmt: skip
    with torch.no_grad():
        code = encoder.encode(vision.as_input(shots))
        drawn = encoder.decode(code)
    parts |= {"images": shots.tobytes(), "image_codes": numbers(code), "drawn": numbers(drawn)}
    return packing.write(folder, "answers", parts, told)


def conflicts(trained, samples, source, test, wording):
    """Every condition of three clips, and the answers: probabilities of words, and joints."""
    rows, words, joints = [], [], []
    own = [int(i) for i in test if samples.variation[i] == 0][:CONFLICT_CLIPS]
    for index in own:
        for condition in (c for signal in EXTRA_INPUT for c in conditions(signal)):
            signal, place, _ = condition
            if place == "congruent_other" and EXTRA_INPUT[signal] == "action":
                continue  # the clip of another variation, which the page has not
            (extra,) = extra_inputs(samples, [index], condition)
            answer = respond_under(trained, source, [index], condition, extra=[extra])
            true = sentence(pattern(int(samples.pattern[index])).meaning, int(wording[index]))
            rows.append({"sample": index, "signal": signal, "place": place, "sentence": true,
                         "extra": extra if isinstance(extra, str) else int(extra),
                         "said": evaluation.sentences(answer)[0]})  # fmt: skip
            words.append(answer.words[0].exp().numpy())
            joints.append(answer.joints[0].numpy())
    return rows, {"words": np.stack(words), "joints": np.stack(joints)}


class Shown(nn.Module):
    """An encoder that has these features of one image after another."""

    def __init__(self, features):
        super().__init__()
        self.rows = iter(torch.from_numpy(features))

    def encode(self, images):
        return next(self.rows)[None]


def watched(samples, test, sentences):
    """What a policy that watches does and says in clips whose cubes jump to those of another."""
    trained = checkpoint.load(artefacts.stored(models.MORE["watching"]))
    image = np.zeros((120, 160, 3), np.uint8)
    rows, joints, words = [], [], []
    for k in range(0, len(test), len(test) // WATCHED):
        index = int(test[k])
        other = index - 1 if samples.variation[index] else index + 1  # the same task
        frames = int(min(samples.frames[[index, other]]))
        features = samples.features[[index] * JUMP + [other] * (frames - JUMP), range(frames)]
        actor = WatchingActor(trained, Shown(features), sentences[k])
        targets = [actor(lambda: image, one.astype(float))
                   for one in samples.joints[index, :frames]]  # fmt: skip
        joints.append(trained.scaling.joints(np.array(targets, np.float32)))
        with torch.no_grad():
            pairs = zip(actor.looks, actor.poses, strict=True)
            keys = torch.stack([torch.cat(pair, 1) for pair in pairs], dim=1)
            clock = torch.tensor([float(frames)])
            scores = trained.model.tell(trained.model.watch(keys), clock, actor.looks[0])
            words.append(scores[0].exp().numpy())
        rows.append({"clip": k, "other": int(np.flatnonzero(test == other)[0]), "frames": frames,
                     "jump": JUMP, "said": actor.describe()})  # fmt: skip
    return rows, {"joints": np.concatenate(joints), "words": np.stack(words)}


# ---------------------------------------------------------------- changed models


@torch.no_grad()
def swapped_gates():
    """Input and forget gates of a cell have changed places."""
    model = ptae()
    weight = model.action.cells[0].weight_ih
    i, f, g, o = weight.chunk(4)
    weight.copy_(torch.cat([f, i, g, o]))
    return {"step": networks.parts_of(model)["step"]}


def missing_bias():
    """The language decoder has lost the bias of its output."""
    model = ptae()
    nn.init.zeros_(model.language.output.bias)
    return {"say": networks.parts_of(model)["say"]}


@torch.no_grad()
def open_gate():
    """A policy that watches goes on looking where the arm hides the cube."""
    model = checkpoint.load(artefacts.stored(models.MORE["watching"])).model
    model.plan.gate.bias.fill_(20)
    return {"follow": networks.parts_of(model)["follow"]}


def wrong_padding():
    """The first convolution of one channel begins at the image's edge."""
    encoder = vision.load_autoencoder(artefacts.stored(files.ENCODER))
    encoder.red.encoder[0].padding = (0, 0)
    return {"encode": networks.parts_of_autoencoder(encoder)["encode"]}


def single_precision():
    """No fault: the weights as they are."""
    return networks.parts_of(ptae())


def ptae():
    return checkpoint.load(artefacts.stored(models.FIRST["ptae"])).model


FAULTS = (swapped_gates, missing_bias, wrong_padding, open_gate)
CHANGES = {one.__name__: one for one in (*FAULTS, single_precision)}


def change(folder, name: str) -> None:
    """Write the networks of a change as a pack of its name."""
    short = name != "single_precision"
    parts = {key: export.graph(part, short) for key, part in CHANGES[name]().items()}
    told = packing.write(folder, name, parts)
    Path(folder, f"{name}.json").write_text(json.dumps(told))


if __name__ == "__main__":
    where, *names = sys.argv[1:]
    told = write(where)
    Path(where, "answers.json").write_text(json.dumps(told))
    for name in names:
        change(where, name)
