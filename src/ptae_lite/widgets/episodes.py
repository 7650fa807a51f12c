"""Episodes of the closed loop to look at: a panel with them, and a box for typing a sentence."""

from __future__ import annotations

from collections.abc import Mapping
from html import escape
from itertools import count

import ipywidgets
import numpy as np
from torch import nn

from ptae_lite.errors import PTAEError, RobotError
from ptae_lite.experiments import watching_shown
from ptae_lite.experiments.episodes import StoredEpisode, perform, side_of, stages
from ptae_lite.language import ACTIONS, MEANINGS, SIDES, SPEEDS, Meaning, alternatives, parse
from ptae_lite.models.checkpoint import Trained
from ptae_lite.robot.scene import TABLE_TOP_M, pybullet
from ptae_lite.run_mode import is_static
from ptae_lite.widgets.panels import Panel
from ptae_lite.widgets.scene3d import arm_scene
from ptae_lite.widgets.viewer import Viewer

MOVED, STAY = "are moved on the way", "stay"  # what happens to the cubes meanwhile
WAY = {"push": "away from the robot", "pull": "towards the robot", "slide": "to the right"}
TEXTS = {  # of a verdict; also for the page that acts by itself
    "verdict": "{how}. The {colour} cube ({side}) {named}, the other one {other}; {pace}.",
    "absent": "There is no {colour} cube here; the left one {left}, the right {right} ({pace}).",
    "done": "Done as the sentence says",
    "not_done": "NOT done: {reason}",
    "went": "went {mm} mm {way}",
    "moved": "moved {mm} mm",
    "fell": "fell off the table",
    "pace": "{frames} frames, {speed} asked for",
    "meanwhile": " The cubes were moved in frame {frame}.",
}


def verdict_text(kept: StoredEpisode) -> str:
    """The verdict as a sentence."""
    meaning, verdict = parse(kept.instruction), kept.verdict
    side = side_of(kept.stage, meaning)
    pace = TEXTS["pace"].format(frames=verdict.frames, speed=meaning.speed)
    cubes = kept.episode.cubes
    fell = cubes[-1, :, 2] < TABLE_TOP_M
    if side is None:
        far_mm = 1000 * np.linalg.norm(cubes[-1, :, :2] - cubes[0, :, :2], axis=1)
        left, right = (
            TEXTS["fell"] if off else TEXTS["moved"].format(mm=f"{far:.0f}")
            for off, far in zip(fell, far_mm, strict=True)
        )
        return TEXTS["absent"].format(colour=meaning.colour, left=left, right=right, pace=pace)
    named = SIDES.index(side)
    went = TEXTS["went"].format(mm=f"{verdict.named_mm:.0f}", way=WAY[meaning.action])
    moved = TEXTS["moved"].format(mm=f"{verdict.other_mm:.0f}")
    said = TEXTS["verdict"].format(
        how=TEXTS["done" if verdict.success else "not_done"].format(reason=verdict.reason),
        colour=meaning.colour, side=side, named=TEXTS["fell"] if fell[named] else went,
        other=TEXTS["fell"] if fell[1 - named] else moved, pace=pace,
    )  # fmt: skip
    if not kept.episode.shift_m.any():
        return said
    return said + TEXTS["meanwhile"].format(frame=kept.episode.event)


class Shown:
    """An episode in 3-D, with its verdict above it."""

    def __init__(self, kept: StoredEpisode):
        self.kept, self.text = kept, verdict_text(kept)
        self.viewer: Viewer = arm_scene(
            kept.episode.joints_rad, kept.episode.cubes, kept.stage.colours,
            title=f"the arm executes: {kept.instruction}",
        )  # fmt: skip

    def _repr_html_(self) -> str:
        return f"<p>{escape(self.text)}</p>{self.viewer._repr_html_()}"


def panel(kept: list[StoredEpisode], start: dict[str, str] | None = None) -> Panel:
    """Choose a scene and a sentence, and see what the model did.

    Args:
        start: values of controls that are not to begin with their first.
    """
    by_key = {(" and ".join(one.stage.colours), parse(one.instruction)): one for one in kept}
    scenes = list(dict.fromkeys(scene for scene, _ in by_key))

    def find(cubes: str, action: str, which: str, speed: str) -> StoredEpisode:
        colours = cubes.split(" and ")
        return by_key[cubes, Meaning(action, colours[which != "the left one"], speed)]

    return Panel(
        lambda **values: Shown(find(**values)),
        {"cubes": scenes, "action": ACTIONS, "which": ("the left one", "the right one"),
         "speed": SPEEDS},
        "Sentence and episode",
        start=start,
        describe=lambda **values: verdict_text(find(**values)),
    )  # fmt: skip


def watching_panel(acted: list[watching_shown.Shown], names: Mapping[str, str]) -> Panel:
    """Choose who acts, whether cubes are moved meanwhile, and a sentence.

    Args:
        names: of the models, as the panel shows them, in their order.
    """
    by_key = {
        (names[one.model], MOVED if one.moved else STAY, parse(one.kept.instruction)): one.kept
        for one in acted
    }
    colours = acted[0].kept.stage.colours

    def find(who: str, cubes: str, action: str, which: str, speed: str) -> StoredEpisode:
        return by_key[who, cubes, Meaning(action, colours[which != "the left one"], speed)]

    return Panel(
        lambda **values: Shown(find(**values)),
        {"who": tuple(names.values()), "cubes": (MOVED, STAY), "action": ACTIONS,
         "which": ("the left one", "the right one"), "speed": SPEEDS},
        "Who acts, and a sentence",
        describe=lambda **values: verdict_text(find(**values)),
    )  # fmt: skip


def answer(
    trained: Trained, encoder: nn.Module, kept: list[StoredEpisode], scene: str, text: str,
    number: int | None = None,
) -> Shown:  # fmt: skip
    """Let the model do what `text` says, in one of the scenes of `episodes.stages`.

    Without PyBullet, the episode is looked up among the stored ones.

    Args:
        number: of the move of the cubes while the arm acts; None for none.

    Raises:
        LanguageError: the sentence is wrong. The message lists the words.
        RobotError: PyBullet is not installed, and no such episode is stored.
    """
    meaning, stage = parse(text.strip().lower()), stages()[scene]
    try:
        pybullet()
    except RobotError:
        for one in kept if number is None else []:
            if one.stage.colours == stage.colours and parse(one.instruction) == meaning:
                return Shown(one)
        raise RobotError(
            f"there is no PyBullet here to act out {text!r}, and no such episode is stored; stored "
            f"are all sentences about the cubes that are there, {scene}"
        ) from None
    moves = number is not None and meaning.colour in stage.colours
    move = watching_shown.move_of(stage, meaning, number, 1) if moves else None
    return Shown(perform(trained, encoder, stage, text.strip().lower(), meaning, move))


class Box:
    """A box for typing a sentence, and the arm that does it.

    A page without a kernel shows a note instead; the panel of stored episodes works there.

    Args:
        policies: models that can act, by name.
        kept: episodes of the first, for where there is no simulator.
    """

    def __init__(
        self, policies: Mapping[str, Trained], encoder: nn.Module, kept: list[StoredEpisode]
    ):
        self.names = tuple(policies)
        self.ask = lambda name, scene, text, number=None: answer(
            policies[name], encoder, kept if name == self.names[0] else [], scene, text, number
        )

    def widget(self) -> ipywidgets.VBox:
        """Policy, scene, sentence and button, and below them what the arm did."""
        who = ipywidgets.Dropdown(options=self.names, description="who acts")
        scene = ipywidgets.Dropdown(options=list(stages()), description="cubes")
        text = ipywidgets.Combobox(
            value="push red slowly", description="sentence", ensure_option=False,
            options=[s for meaning in MEANINGS for s in alternatives(meaning)],
        )  # fmt: skip
        act = ipywidgets.Button(description="Act")
        snatch = ipywidgets.Button(description="Snatch the cubes away")
        snatch.layout.width = "auto"
        view, numbers = ipywidgets.HTML(), count()

        def show(number: int | None) -> None:
            act.disabled = snatch.disabled = True
            try:
                view.value = self.ask(who.value, scene.value, text.value, number)._repr_html_()
            except PTAEError as error:
                view.value = f'<p role="alert">{escape(str(error))}</p>'
            finally:
                act.disabled = snatch.disabled = False

        act.on_click(lambda _click: show(None))
        snatch.on_click(lambda _click: show(next(numbers)))
        buttons = ipywidgets.HBox([act, snatch])
        return ipywidgets.VBox([who, scene, text, buttons, view])

    def _repr_mimebundle_(self, include=None, exclude=None) -> dict:
        if is_static():
            note = "In a notebook, a box stands here for typing any sentence; a kernel acts it out."
            return {"text/html": f"<p><em>{note}</em></p>", "text/plain": note}
        return self.widget()._repr_mimebundle_() | {"text/plain": "a box to type a sentence"}
