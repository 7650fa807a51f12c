"""A panel that shows the arm at work: one recorded sample of each of the 12 actions."""

from __future__ import annotations

from functools import partial

from ptae_lite.data import frames
from ptae_lite.data.samples import Samples
from ptae_lite.language import ACTIONS, SIDES, SPEEDS, pattern
from ptae_lite.widgets.panels import Panel
from ptae_lite.widgets.scene3d import sample_scene
from ptae_lite.widgets.viewer import Viewer


def video_sample(samples: Samples, action: str, side: str, speed: str) -> int:
    """The sample of an action whose video is stored.

    Raises:
        ValueError: there is no such action.
    """
    for index in frames.video_patterns():
        one = pattern(index)
        if (one.action, one.side, one.speed) == (action, side, speed):
            return int(((samples.pattern == index) & (samples.variation == 0)).argmax())
    raise ValueError(f"no video of {action} {side} {speed}")


def scene(samples: Samples, action: str, side: str, speed: str) -> Viewer:
    """One action as a scene that plays by itself, with the camera's pictures."""
    return sample_scene(
        samples, video_sample(samples, action, side, speed), eye=True, autoplay=True
    )


def panel(samples: Samples) -> Panel:
    """Choose an action, a cube and a speed, and watch the arm do it."""
    return Panel(
        partial(scene, samples),
        {"action": list(ACTIONS), "side": list(SIDES), "speed": list(SPEEDS)},
        "Tell the arm what to do",
        labels={"side": "cube"},
    )
