"""The parts of a model that a page runs, each as a network of its own.

A page calls them one after another, as `PTAE.forward` does: `encode` once, `say` once for the
words, `start` once and `step` for each pose. A policy that watches has `encode`, then `task` once
and `follow` for each frame; at the end `encode` and `tell`. All take and give a batch of one.
"""

from __future__ import annotations

from copy import deepcopy
from dataclasses import dataclass

import torch
from torch import Tensor, nn

from ptae_lite.data.samples import MAX_FRAMES
from ptae_lite.data.signals import TOKENS_IN, WORDS_OUT, Batch
from ptae_lite.models.decoders import RecurrentDecoder
from ptae_lite.models.hand_planner import Memory
from ptae_lite.models.ptae import PTAE
from ptae_lite.models.watching import KINDS, Watcher
from ptae_lite.robot.closed_loop import LIMIT
from ptae_lite.vision.autoencoder import ChannelSeparatedCAE


@dataclass(frozen=True)
class Part:
    """A network, and what it takes and gives.

    Attributes:
        inputs: an example of each input, by name.
        outputs: the names of the outputs.
        any_length: the inputs whose second axis may be shorter.
    """

    network: nn.Module
    inputs: dict[str, Tensor]
    outputs: tuple[str, ...]
    any_length: tuple[str, ...] = ()


class Encode(nn.Module):
    """Query and keys to the code (1, H) and the attention weights (1, heads, 6, T)."""

    def __init__(self, model: PTAE):
        super().__init__()
        self.model = model

    def forward(self, tokens, token_mask, keys, frames):
        seen = keys[:, 1:, : self.model.config.features]
        batch = Batch(tokens, token_mask, frames, keys, seen, *[keys] * 5)
        code, weights = self.model.encode(self.model._shown(batch))
        return code, weights


class Say(nn.Module):
    """The code to the logarithms of the word probabilities, (1, 4, 23)."""

    def __init__(self, model: PTAE):
        super().__init__()
        self.decoder = model.language

    def forward(self, code):
        return self.decoder(code, WORDS_OUT)


class Start(nn.Module):
    """The code to the first states of a decoder: hidden state and memory of each layer."""

    def __init__(self, decoder: RecurrentDecoder):
        super().__init__()
        self.decoder = decoder

    def forward(self, code):
        return tuple(part for state in self.decoder.first_state(code) for part in state)


class Step(nn.Module):
    """A frame's features, the last pose and the states to the next pose and the next states."""

    def __init__(self, model: PTAE):
        super().__init__()
        self.decoder = model.action

    def forward(self, code, frame, pose, *states):
        pairs = list(zip(states[::2], states[1::2], strict=True))
        pose, after = self.decoder.move(code, frame, pose, pairs)
        return pose, *(part for state in after for part in state)


def parts_of(model: PTAE | Watcher) -> dict[str, Part]:
    """The four parts of a PTAE, or of a policy that watches."""
    return parts_of_watcher(model) if model.kind == "watcher" else parts_of_ptae(model)


def parts_of_ptae(model: PTAE) -> dict[str, Part]:
    """The four parts of a PTAE."""
    c = model.config
    code, state = torch.zeros(1, c.hidden), torch.zeros(1, c.decoder_units)
    names = [f"{what}{i}" for i in range(c.decoder_layers) for what in ("hidden", "memory")]
    query = {
        "tokens": torch.zeros(1, TOKENS_IN, dtype=torch.long),
        "token_mask": torch.ones(1, TOKENS_IN, dtype=torch.bool),
        "keys": torch.zeros(1, MAX_FRAMES, c.features + c.joints),
        "frames": torch.full((1,), MAX_FRAMES),
    }
    seen = {"code": code, "frame": torch.zeros(1, c.features), "pose": torch.zeros(1, c.joints)}
    states = {name: state.clone() for name in names}
    after = tuple(f"{name}_after" for name in names)
    return {
        "encode": Part(Encode(model), query, ("code", "attention"), ("keys",)),
        "say": Part(Say(model), {"code": code}, ("words",)),
        "start": Part(Start(model.action), {"code": code}, tuple(names)),
        "step": Part(Step(model), seen | states, ("pose_after", *after)),
    }


class ReadTask(nn.Module):
    """The code of a sentence and the first look to the task, one of each, and the first memory."""

    def __init__(self, model: Watcher):
        super().__init__()
        self.model = model

    def forward(self, code, first):
        plan = self.model.plan
        numbers = self.model.understand(code, first)
        place = self.model.read(numbers, first[:, None])[:, 0]
        states = [place.new_zeros(layer.num_layers, 1, layer.hidden_size)
                  for layer in (plan.attend, plan.lstm, plan.lstm)]  # fmt: skip
        return one_of_each(numbers), place, *states


class Follow(nn.Module):
    """A task, what is seen, where the hand is and the memory to a wish, in m, and the memory."""

    def __init__(self, model: Watcher):
        super().__init__()
        self.model = model

    def forward(self, task, seen, hand, place, attention, hidden, cell):
        both = self.model.places(seen)
        read = (both * task[:, : KINDS[0], None]).sum(1, keepdim=True)
        memory = Memory(place, attention, (hidden, cell))
        wish, _, after = self.model.plan(task, read, hand[:, None], memory)
        return wish[:, 0], after.place_m, after.attention, *after.states


class Tell(nn.Module):
    """The code of what was watched, the number of frames and the first look to the words."""

    def __init__(self, model: Watcher):
        super().__init__()
        self.model = model

    def forward(self, code, first, count):
        return self.model.tell(code, count, first)


def one_of_each(numbers: Tensor) -> Tensor:
    """`watching.one_of_each` in operations that a runtime has in a few kilobytes."""
    parts = [torch.arange(kinds) == numbers[:, i, None] for i, kinds in enumerate(KINDS)]
    return torch.cat([part.float() for part in parts], dim=1)


def parts_of_watcher(model: Watcher) -> dict[str, Part]:
    """The four parts of a policy that watches."""
    encode = parts_of_ptae(model.ptae)["encode"]
    encode.inputs["keys"] = torch.zeros(1, LIMIT, encode.inputs["keys"].shape[2])
    encode.inputs["frames"] = torch.full((1,), LIMIT)
    p, names = model.config.ptae, ("place", "attention", "hidden", "cell")
    code, seen = torch.zeros(1, p.hidden), torch.zeros(1, p.features)
    looked = {"code": code, "first": seen}
    begun = dict(zip(("task", *names), ReadTask(model)(*looked.values()), strict=True))
    now = {"seen": seen, "hand": torch.zeros(1, 3)}
    after = tuple(f"{name}_after" for name in names)
    return {
        "encode": encode,
        "task": Part(ReadTask(model), looked, tuple(begun)),
        "follow": Part(Follow(model), {"task": begun.pop("task")} | now | begun, ("wish", *after)),
        "tell": Part(Tell(model), looked | {"count": torch.ones(1)}, ("words",)),
    }


class EncodeImage(nn.Module):
    """An image (1, 3, 120, 160), values 0 to 1, to its features (1, F)."""

    def __init__(self, autoencoder: nn.Module):
        super().__init__()
        self.autoencoder = autoencoder

    def forward(self, image):
        return self.autoencoder.encode(image)


class DecodeImage(EncodeImage):
    """Features (1, F) to an image (1, 3, 120, 160), values 0 to 1."""

    def forward(self, features):
        return self.autoencoder.decode(features)


def parts_of_autoencoder(autoencoder: ChannelSeparatedCAE) -> dict[str, Part]:
    """The two halves of an autoencoder, its linear layers multiplied together."""
    small = folded(autoencoder)
    image, features = torch.zeros(1, 3, 120, 160), torch.zeros(1, 3 * autoencoder.code)
    return {
        "encode": Part(EncodeImage(small), {"image": image}, ("features",)),
        "decode": Part(DecodeImage(small), {"features": features}, ("image",)),
    }


def folded(autoencoder: ChannelSeparatedCAE) -> ChannelSeparatedCAE:
    """A copy in which linear layers that follow each other are one: nothing lies between them.

    It computes the same with a third of the numbers.
    """
    made = deepcopy(autoencoder)
    for cae in (made.red, made.green, made.blue):
        cae.encoder, cae.decoder = _folded(cae.encoder), _folded(cae.decoder)
    return made


def _folded(layers: nn.Sequential) -> nn.Sequential:
    kept: list[nn.Module] = []
    for layer in layers:
        if isinstance(layer, nn.Linear) and kept and isinstance(kept[-1], nn.Linear):
            layer = _product(kept.pop(), layer)
        kept.append(layer)
    return nn.Sequential(*kept)


@torch.no_grad()
def _product(first: nn.Linear, second: nn.Linear) -> nn.Linear:
    """One layer for two, multiplied in double precision."""
    weight = second.weight.double() @ first.weight.double()
    bias = second.weight.double() @ first.bias.double() + second.bias.double()
    made = nn.Linear(first.in_features, second.out_features)
    made.weight.copy_(weight)
    made.bias.copy_(bias)
    return made
