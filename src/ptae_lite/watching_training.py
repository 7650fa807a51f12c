"""The training of a watching policy, part after part. The PTAE below it stays as it is.

1. `MeaningReader`: codes of the clips' sentences, all eight of each, to what they say.
2. `ColourReader`: features to the colours of the cubes, in the frames before the touch.
3. `PlaceReader`: features to the places of the cubes, in the same frames.
4. `HandPlanner`: measured hands and read places to the hand's next place. It is given the true task
   and what the trained reader reads.
5. `Teller`: codes of whole clips, and their durations, to their sentences and sides.

Each part has one cycle of AdamW's learning rate. Losses of places are in centimetres, squared.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass, fields

import numpy as np
import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor, nn
from torch.nn import functional

from ptae_lite import controls, devices
from ptae_lite.data.demonstrations import REST, Demonstrations
from ptae_lite.data.scaling import Scaling
from ptae_lite.data.signals import WORDS_OUT
from ptae_lite.errors import ConfigError, TrainingError
from ptae_lite.language import (
    ACTIONS,
    COLOURS,
    SIDES,
    SPEEDS,
    Meaning,
    alternatives,
    encode,
    patterns,
    signal_index,
)
from ptae_lite.models import kinematics
from ptae_lite.models.checkpoint import Trained
from ptae_lite.models.watching import Watcher, WatcherConfig

CM = 0.01
STRETCH = (0.9, 1.15)  # of a clip's duration for the teller: own acts are shorter or longer


@dataclass(frozen=True)
class WatchingRecipe:
    """How a watching policy is trained. Settings are chosen on held-out patterns.

    Raises:
        ConfigError: a value makes no sense.
    """

    meaning_steps: int = 500
    colour_steps: int = 1500
    place_steps: int = 4000
    plan_steps: int = 1500
    teller_steps: int = 1500
    frames: int = 256  # in a batch of codes or of single frames
    clips: int = 32  # in a batch of clips, all of one speed
    learning_rate: float = 3e-3  # the peak
    weight_decay: float = 0.01  # of the three readers
    teller_decay: float = 1.0  # of the teller, which otherwise learns the clips by heart
    feature_noise: float = 0.02  # in network units, of the readers of colours and places
    hand_noise_m: float = 0.003  # of the measured hand: it must not copy its last step
    remember_weight: float = 1.0  # of the remembered place's loss
    clip_norm: float = 1.0
    seed: int = 0

    def __post_init__(self):
        small = [f.name for f in fields(self) if f.type == "int" and getattr(self, f.name) < 1]
        if [name for name in small if name != "seed"]:
            raise ConfigError(f"{small[0]} is {getattr(self, small[0])}; it must be 1 or more")


@dataclass(frozen=True)
class Prepared:
    """Clips as tensors, in the units of the network."""

    keys: Float[Tensor, "C T K"]
    features: Float[Tensor, "C T F"]
    hand_m: Float[Tensor, "C T 3"]
    goal_m: Float[Tensor, "C T 3"]
    places_m: Float[Tensor, "C T 2 2"]
    remembered_m: Float[Tensor, "C T 2"]
    before_touch: Bool[Tensor, "C T"]
    frames: Int[Tensor, " C"]
    task: Int[Tensor, "C 3"]
    meaning: Int[Tensor, "C 3"]
    colours: Int[Tensor, "C 2"]
    sentences: Int[Tensor, "C 8 5"]

    @classmethod
    def of(cls, given: Demonstrations, scaling: Scaling) -> Prepared:
        """The clips, scaled for a PTAE."""
        features, joints = scaling.features(given.features), scaling.joints(given.joints_rad)
        asked = [patterns()[i] for i in given.pattern]
        return cls(
            keys=_floats(np.concatenate([features, joints], axis=2)), features=_floats(features),
            hand_m=kinematics.fingertip(_floats(given.joints_rad)), goal_m=_floats(given.goal_m),
            places_m=_floats(given.places_m), remembered_m=_floats(given.remembered_m),
            before_touch=torch.from_numpy(given.before_touch),
            frames=torch.from_numpy(given.frames), task=torch.tensor([numbers(p) for p in asked]),
            meaning=torch.tensor([said(p.meaning) for p in asked]),
            colours=torch.tensor([[COLOURS.index(c) for c in p.arrangement] for p in asked]),
            sentences=torch.tensor(
                [[encode(s) for s in alternatives(p.meaning)] for p in asked]
            ),
        )  # fmt: skip

    def by_length(self) -> Iterator[tuple[int, Tensor]]:
        """The clip lengths, and which clips have them."""
        for length in self.frames.unique().tolist():
            yield length, (self.frames == length).nonzero()[:, 0]


def numbers(shown) -> list[int]:
    """Side, action and speed of a pattern as numbers."""
    return [SIDES.index(shown.side), ACTIONS.index(shown.action), SPEEDS.index(shown.speed)]


def said(meaning: Meaning) -> list[int]:
    """Action, colour and speed of a meaning as numbers."""
    kinds = (ACTIONS, COLOURS, SPEEDS)
    return [words.index(word) for words, word in zip(kinds, meaning, strict=True)]


def queries(sentences: Int[Tensor, "N 5"]) -> Int[Tensor, "N 6"]:
    """The tokens that ask to execute sentences."""
    signal = torch.full((len(sentences), 1), signal_index("execute"))
    return torch.cat([signal, sentences], dim=1)


def _floats(array) -> Tensor:
    return torch.from_numpy(np.asarray(array, dtype=np.float32))


def train(
    base: Trained, shown: Demonstrations, recipe: WatchingRecipe, blind: bool = False,
    on_part=lambda name, loss: None,
) -> Trained:  # fmt: skip
    """Train a watching policy on a PTAE.

    Args:
        base: the PTAE, made with `condition_on_code` and without `pad_still_frame`.
        blind: the control that sees the first image only.
        on_part: called after each part with its name and its last mean loss.

    Raises:
        ConfigError: the base is not a PTAE that acts from one look.
        TrainingError: a loss is no number any more.
    """
    if base.model.kind != "ptae" or base.model.config.pad_still_frame:
        raise ConfigError("a watching policy is built on a PTAE without pad_still_frame")
    begun, losses = time.process_time(), {}
    with devices.seeded(recipe.seed, "cpu"):
        model = Watcher(WatcherConfig(ptae=base.model.config, blind=blind))
        model.ptae.load_state_dict(base.model.state_dict())
        model.eval()  # no dropout in the PTAE below
        for parameter in model.ptae.parameters():
            parameter.requires_grad_(False)
        data = Prepared.of(shown, base.scaling)
        for name, part in PARTS.items():
            losses[name] = part(model, data, recipe)
            on_part(name, losses[name])
    about = {
        "encoder": base.about["encoder"], "holdout": base.about.get("holdout"),
        "split": base.about["split"], "recipe": asdict(recipe), "clips": len(shown),
        "steps": sum(getattr(recipe, f"{name}_steps") for name in PARTS),
        "losses": losses, "seconds": round(time.process_time() - begun, 1),
        "base_experiment": base.about.get("experiment", ""),
    }  # fmt: skip
    return Trained(model, base.scaling, about)


def fit_meaning(model: Watcher, data: Prepared, recipe: WatchingRecipe) -> float:
    """Train the reader of the sentence."""
    with torch.no_grad():
        codes = model.code_of_sentence(queries(data.sentences.flatten(0, 1)))
    meanings = data.meaning.repeat_interleave(data.sentences.shape[1], dim=0)

    def loss(_):
        drawn = torch.randint(len(codes), (recipe.frames,))
        pairs = zip(model.meaning(codes[drawn]), meanings[drawn].unbind(1), strict=True)
        return sum(functional.cross_entropy(scores, true) for scores, true in pairs)

    return _cycle(model.meaning, loss, recipe.meaning_steps, recipe, recipe.weight_decay)


def fit_colours(model: Watcher, data: Prepared, recipe: WatchingRecipe) -> float:
    """Train the reader of colours."""
    clip = data.before_touch.nonzero()[:, 0]

    def loss(seen, drawn):
        scores = model.colours(seen).flatten(0, 1)
        return functional.nll_loss(scores, data.colours[clip[drawn]].flatten())

    return _read(model.colours, data, loss, recipe.colour_steps, recipe)


def fit_places(model: Watcher, data: Prepared, recipe: WatchingRecipe) -> float:
    """Train the reader of places."""
    places = data.places_m[data.before_touch]

    def loss(seen, drawn):
        return ((model.places(seen) - places[drawn]) / CM).square().mean()

    return _read(model.places, data, loss, recipe.place_steps, recipe)


def _read(reader: nn.Module, data: Prepared, loss: Callable, steps: int, recipe: WatchingRecipe):
    """Train a reader of single frames before the touch. `loss` is given some, and which."""
    seen = data.features[data.before_touch]

    def of_step(_):
        drawn = torch.randint(len(seen), (recipe.frames,))
        shown = seen[drawn]
        return loss(shown + recipe.feature_noise * torch.randn_like(shown), drawn)

    return _cycle(reader, of_step, steps, recipe, recipe.weight_decay)


def fit_plan(model: Watcher, data: Prepared, recipe: WatchingRecipe) -> float:
    """Train the planner of the hand, on clips of one speed at a time."""
    with torch.no_grad():
        read = model.read(data.task, data.features)
    groups = [which for speed in (0, 1) if len(which := (data.task[:, 2] == speed).nonzero()[:, 0])]
    share = torch.tensor([len(which) for which in groups]) / len(data.task)

    def loss(_):
        group = groups[int(torch.multinomial(share, 1))]
        drawn = group[torch.randint(len(group), (recipe.clips,))]
        count = int(data.frames[drawn].max()) + REST
        hand = data.hand_m[drawn, :count]
        hand = hand + recipe.hand_noise_m * torch.randn_like(hand)
        wish, kept, _ = model.follow(data.task[drawn], read[drawn, :count], hand)
        wrong = ((wish - data.goal_m[drawn, :count]) / CM).square().mean()
        if model.config.blind:
            return wrong
        forgot = ((kept - data.remembered_m[drawn, :count]) / CM).square().mean()
        return wrong + recipe.remember_weight * forgot

    return _cycle(model.plan, loss, recipe.plan_steps, recipe)


def fit_teller(model: Watcher, data: Prepared, recipe: WatchingRecipe) -> float:
    """Train what is told of a clip: its side, and its words, of which duration decides the speed.

    Half of the clips are said to have taken as long as those of the other speed, and their
    sentences say so. The teller must then look at the clock, and not at the frames.
    """
    codes, slow = clip_codes(model, data), data.task[:, 2] == SPEEDS.index("slowly")
    other = controls.other_speed()

    def loss(_):
        drawn = torch.randint(len(codes), (recipe.frames,))
        times = data.frames[drawn] * torch.empty(len(drawn)).uniform_(*STRETCH)
        words = data.sentences[drawn, torch.randint(8, (len(drawn),)), 1:]
        turned = torch.rand(len(drawn)) < 0.5
        times = torch.where(turned, times * torch.where(slow[drawn], 0.5, 2.0), times)
        words = torch.where(turned[:, None], other[words], words)
        changed, side = model.teller(codes[drawn], times)
        right = model.ptae.language(changed, WORDS_OUT).gather(2, words[..., None])
        return functional.nll_loss(side, data.task[drawn, 0]) - right.mean()

    return _cycle(model.teller, loss, recipe.teller_steps, recipe, recipe.teller_decay)


@torch.no_grad()
def clip_codes(model: Watcher, data: Prepared) -> Float[Tensor, "C H"]:
    """Codes of whole clips, without the frames after their ends."""
    codes = torch.empty(len(data.task), model.config.ptae.hidden)
    for length, which in data.by_length():
        for part in which.split(50):
            codes[part] = model.watch(data.keys[part, :length])
    return codes


PARTS: dict[str, Callable] = {
    "meaning": fit_meaning, "colour": fit_colours, "place": fit_places, "plan": fit_plan,
    "teller": fit_teller,
}  # fmt: skip


def _cycle(part: nn.Module, loss: Callable, steps: int, recipe: WatchingRecipe,
           decay: float = 0.0) -> float:  # fmt: skip
    """Minimise `loss(step)`; returns the mean loss of the last tenth of the steps."""
    parameters, rate = list(part.parameters()), recipe.learning_rate
    optimiser = torch.optim.AdamW(parameters, rate, weight_decay=decay, fused=True)
    schedule = torch.optim.lr_scheduler.OneCycleLR(optimiser, rate, total_steps=steps)
    last = []
    for step in range(steps):
        value = loss(step)
        if not torch.isfinite(value):
            raise TrainingError(f"the training broke off at update {step + 1}: no finite loss")
        optimiser.zero_grad()
        value.backward()
        nn.utils.clip_grad_norm_(parameters, recipe.clip_norm)
        optimiser.step()
        schedule.step()
        if step >= 0.9 * steps - 1:
            last.append(value.item())
    return float(np.mean(last))
