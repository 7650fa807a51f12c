"""A panel for one clip under conflict: what the model gets, and what it answers.

A card is HTML. It has the words and the pictures with the conflicting parts marked, the answer
beside truth and distractor, and for motions both arms in one 3-D scene. Nothing is shown by colour
alone: a conflicting part has the sign ≠ and a double line.
"""

from __future__ import annotations

import io
from base64 import b64encode
from dataclasses import dataclass, replace
from functools import cache, cached_property
from html import escape

import numpy as np
import pandas as pd
from PIL import Image

from ptae_lite.data.samples import Samples
from ptae_lite.experiments.answer_source import SOURCES, distractor_of, truth_of
from ptae_lite.experiments.conflict_examples import ConflictExamples
from ptae_lite.experiments.incongruence import (
    ANSWERS_WORDS,
    ASPECTS,
    EXTRA_INPUT,
    Condition,
    conflict_sets,
)  # fmt: skip
from ptae_lite.language import Pattern, pattern, sentence
from ptae_lite.plots.incongruence import FILLS, score_name
from ptae_lite.widgets.panels import Panel
from ptae_lite.widgets.scene3d import arm_scene

SIGNALS = ("repeat language", "execute", "describe", "repeat action")
PLACES = {"all of it": "", "video only": "vision", "joints only": "proprioception", "none": None}
FIRST = ("action", "cube", "speed")  # the first false aspect; after the last comes the first again
CELL = 'style="padding:.15em .5em"'
MARK = "border-bottom:3px double #D55E00;font-weight:bold"


def condition_of(signal: str, extra: str, conflicts: int, first: str) -> Condition:
    """The condition that the panel's controls stand for.

    Without an extra input there is no conflict. With an extra input and no conflict, it is the
    congruent control. In a sentence, "video only" and "joints only" mean the whole sentence.
    """
    place, kind = PLACES[extra], EXTRA_INPUT[signal]
    if place is None:
        return Condition(signal)
    if not conflicts:
        return Condition(signal, "congruent")
    start = FIRST.index(first)
    chosen = {(start + k) % 3 for k in range(conflicts)}
    aspects = tuple(aspect for k, aspect in enumerate(ASPECTS[kind]) if k in chosen)
    assert aspects in conflict_sets(signal, conflicts)
    return Condition(signal, place if place and kind == "action" else kind, aspects)


@dataclass(frozen=True, eq=False)
class Card:
    """What one clip gets and what is answered under one condition, as HTML."""

    samples: Samples
    examples: ConflictExamples
    table: pd.DataFrame
    condition: Condition

    @cached_property
    def html(self) -> str:
        """The whole card."""
        words = self.condition.signal in ANSWERS_WORDS
        parts = [self._given(), self._extra(), self._answer(), self._shares()]
        return "".join(parts) + ("" if words else self._scene())

    def _repr_html_(self) -> str:
        return self.html

    @property
    def own(self) -> Pattern:
        """The pattern of the clip."""
        return pattern(int(self.samples.pattern[self.examples.index]))

    @property
    def row(self):
        """The row of the examples for this condition."""
        return self.examples.of(self.condition)

    def _given(self) -> str:
        """The task and its regular input."""
        signal, own = self.condition.signal, self.own
        still = EXTRA_INPUT[signal] == "action"
        if not still:
            given = f"It sees a clip: {_clip(own)}."
        else:
            sees = "sees" if self.condition.conflict_in == "none" else "would see"
            given = (f"It reads <q>{sentence(own.meaning)}</q>, and {sees} the first frame of that "
                     f"clip standing still ({own.left} left, {own.right} right).")  # fmt: skip
        return f"<p><b>{signal}.</b> {given}</p>{self._strip(own, still)}"

    def _extra(self) -> str:
        """The extra input, with its conflicting parts marked."""
        signal, place, aspects = self.condition
        if place == "none":
            return "<p>No extra input.</p>"
        row, own = self.row, self.own
        if EXTRA_INPUT[signal] == "language":
            said = " ".join(
                _marked(word, f"not {true}") if aspect in aspects else word
                for word, true, aspect in zip(
                    row.sentence.split(), own.meaning, ASPECTS["language"], strict=True
                )
            )
            return f"<p>Extra input, a sentence: <q>{said}</q></p>"
        other = pattern(int(self.samples.pattern[row.clip]))
        parts = {"action": other.action, "position": f"{other.side} cube", "speed": other.speed}
        true = {"action": own.action, "position": f"{own.side} cube", "speed": own.speed}
        shown = ", ".join(
            _marked(part, f"not {true[aspect]}") if aspect in aspects else part
            for aspect, part in parts.items()
        )
        whose = "another clip" if aspects else "its own moving clip"
        what = {"vision": "the <b>video</b> of another clip, and the joints of its own",
                "proprioception": "the <b>joints</b> of another clip, and the video of its own",
                }.get(place, f"{whose}, video and joints")  # fmt: skip
        seen = own if place == "proprioception" else other
        return f"<p>Instead: {what}: {shown}.</p>{self._strip(seen, False, seen is not own)}"

    def _answer(self) -> str:
        """Truth, distractor and answer, and what the answer follows."""
        signal, place, aspects = self.condition
        index, row = self.examples.index, self.row
        extra = row.sentence if EXTRA_INPUT[signal] == "language" else row.clip
        rows = [("truth", _said(truth_of(self.samples, index, signal), signal))]
        if aspects:
            distractor = distractor_of(self.samples, index, extra, self.condition)
            rows.append(("distractor", _said(distractor, signal)))
        answer = escape(row.answer) or "(nothing)"
        if signal not in ANSWERS_WORDS:
            answer = f"nearest to: {answer}, {row.distance:.1f} % away"
        rows.append(("the model", f"<b>{answer}</b>"))
        verdict = row.source if aspects or row.source == "truth" else "not the truth"
        rows.append(("follows", f"<b>{verdict}</b>"))
        cells = "".join(
            f"<tr><td {CELL}>{name}</td><td {CELL}>{text}</td></tr>" for name, text in rows
        )
        return f'<table style="margin:1em 0">{cells}</table>'

    def _shares(self) -> str:
        """The score of all test clips under the condition, and what their answers follow."""
        signal, place, aspects = self.condition
        rows = self.table[
            (self.table["signal"] == signal) & (self.table["conflict_in"] == place)
            & (self.table["aspects"] == " ".join(aspects))
        ]  # fmt: skip
        name = score_name(signal)
        score = f"{'accuracy' if name == 'accuracy' else 'NRMSE'} {rows[name].mean():.1f} %"
        shares = {who: rows[who].mean() for who in SOURCES}
        bar = "".join(
            f'<span style="width:{share:.1f}%;background:{_fill(who)}"></span>'
            for who, share in shares.items() if share
        )  # fmt: skip
        texts = ", ".join(f"{who} {share:.0f} %" for who, share in shares.items())
        return (
            f"<p>All 216 test clips, mean of {rows['seed'].nunique()} models: {score}. "
            f"They follow: {texts}.</p>"
            f'<span role="img" aria-label="{texts}" style="display:flex;height:12px;'
            f'max-width:30rem;margin-bottom:1em">{bar}</span>'
        )

    def _strip(self, shown: Pattern, still: bool, false: bool = False) -> str:
        """Six pictures of a clip from first to last, or its first one alone."""
        picture_strips = self.examples.strips[shown.action_index]
        picture_strips = picture_strips[:1] if still else picture_strips
        edge = "3px double #D55E00" if false else "1px solid #888"
        name = "first frame of" if still else "six pictures of"
        return (
            f'<img alt="{name} {_clip(shown)}" style="width:{5 * len(picture_strips)}rem;'
            f'max-width:100%;border:{edge};padding:2px" '
            f'src="{_webp(np.concatenate(list(picture_strips), axis=1))}">'
        )

    def _scene(self) -> str:
        """The recorded arm, and a faint one as the model moves it, as in every scene of a model."""
        index, count = self.examples.index, int(self.samples.frames[self.examples.index])
        true = self.samples.joints[index, :count]
        made = np.concatenate([true[:1], self.examples.joints[self.row.track][: count - 1]])
        scene = arm_scene(
            true, self.samples.cubes[index, :count], self.own.arrangement, ghost_joints_rad=made,
            ghost_name="that of the model. Solid: the recorded one", still_png=b"\x89PNG",
            title=f"{self.condition.signal}: the recorded arm, and the model's faintly",
        )  # fmt: skip
        return replace(scene, still_png=None, height_px=360)._repr_html_()


def panel(samples: Samples, examples: ConflictExamples, table: pd.DataFrame) -> Panel:
    """Choose a signal, its extra input, how many conflicts, and the first false aspect."""

    @cache
    def card(condition: Condition) -> Card:
        return Card(samples, examples, table, condition)

    def show(signal: str, extra: str, conflicts: int, first: str) -> Card:
        return card(condition_of(signal, extra, conflicts, first))

    return Panel(
        show,
        {"signal": list(SIGNALS), "extra": list(PLACES), "conflicts": [0, 1, 2, 3],
         "first": list(FIRST)},
        "One test clip under conflict",
        start={"conflicts": 1},
        labels={"extra": "extra input", "first": "false first"},
    )  # fmt: skip


def _clip(shown: Pattern) -> str:
    cubes = f"{shown.left} left, {shown.right} right"
    return f"{shown.action} the {shown.side} cube {shown.speed} ({cubes})"


def _said(rows, signal: str) -> str:
    action, cube, speed = rows
    if signal not in ANSWERS_WORDS:
        cube = f"the {cube} cube" if cube else "a cube that is not there"
    return f"{action} {cube} {speed}"


def _marked(text: str, true: str) -> str:
    return f'<span style="{MARK}">≠ {escape(text)}</span> <small>({escape(true)})</small>'


def _fill(who: str) -> str:
    """A bar's colour; each has stripes of another direction."""
    colour, hatch = FILLS[who]
    if not hatch:
        return colour
    turn = {"///": 45, "...": 90, "xx": 135}[hatch]
    return f"repeating-linear-gradient({turn}deg,{colour} 0 5px,#ffffff 5px 7px)"


def _webp(image: np.ndarray) -> str:
    small = io.BytesIO()
    Image.fromarray(image).save(small, "WEBP", quality=60, method=6)
    return f"data:image/webp;base64,{b64encode(small.getvalue()).decode('ascii')}"
