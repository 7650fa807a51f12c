"""Acting in the scene: the camera closes the loop, nobody tells the length, millimetres decide."""

import numpy as np
import pytest

from ptae_lite.errors import ConfigError, RobotError
from ptae_lite.language import pattern, sentence
from ptae_lite.robot import closed_loop, inverse, motions
from ptae_lite.robot.closed_loop import Episode, judge


def episode(named_mm=(60, 0), other_mm=0.0, frames=100, stopped="home", height_m=0.585):
    """The left cube goes `named_mm` (x, y), the right one `other_mm` along x."""
    cubes = np.zeros((frames, 2, 7))
    cubes[:, :, 2] = 0.585
    cubes[-1, 0, 2] = height_m
    cubes[-1, 0, :2] = np.array(named_mm) / 1000
    cubes[-1, 1, 0] = other_mm / 1000
    return Episode(np.zeros((frames, 5)), cubes, stopped)


@pytest.mark.parametrize(
    ("made", "asked", "reason"),
    [
        (episode(), ("push", "left", "slowly"), "done"),
        (episode((-60, 0), frames=50), ("pull", "left", "fast"), "done"),
        (episode((0, -60)), ("slide", "left", "slowly"), "done"),
        (episode((40, 30)), ("push", "left", "slowly"), "done"),
        (episode((39.9, 0)), ("push", "left", "slowly"), "the cube went too little that way"),
        (episode(), ("pull", "left", "slowly"), "the cube went too little that way"),
        (episode(other_mm=10), ("push", "left", "slowly"), "the other cube was moved"),
        (episode(), ("push", "right", "slowly"), "the other cube was moved"),
        (episode(), ("push", "left", "fast"), "the wrong speed"),
        (episode(frames=74), ("push", "left", "slowly"), "the wrong speed"),
        (episode(height_m=0.5), ("push", "left", "slowly"), "the cube fell off the table"),
        (episode(stopped="limit"), ("push", "left", "slowly"), "it did not come home"),
        (episode(stopped="joint"), ("push", "left", "slowly"), "a joint at its limit"),
    ],
)
def test_the_verdict_is_in_millimetres_and_frames(made, asked, reason):
    verdict = judge(made, *asked)
    assert (verdict.reason, verdict.success) == (reason, reason == "done")
    assert verdict.frames == len(made.joints_rad)


def plan_of(p, variation):
    return motions.plan(p, motions.draw(motions.sample_seed(p.index, variation)))


@pytest.mark.parametrize("index", [0, 76])
def test_a_replayed_plan_does_what_was_asked(simulator, index):
    p = pattern(index)
    stage = closed_loop.stage_of(p, 2)
    seen, recorded = [], closed_loop.replay(plan_of(p, 2))

    def watching(look, joints_rad):
        seen.append(look())
        return recorded(look, joints_rad)

    made = closed_loop.perform(stage, watching)
    assert judge(made, p.action, p.side, p.speed).success
    assert made.stopped == "home" and len(seen) == len(made.joints_rad) - 1
    assert seen[0].shape == (120, 160, 3) and (seen[0] != seen[30]).any()


def test_an_arm_that_never_moves_is_stopped(simulator):
    p = pattern(0)
    made = closed_loop.perform(closed_loop.stage_of(p, 0), lambda look, joints: inverse.home_rad(),
                               limit=8)  # fmt: skip
    assert made.stopped == "limit" and len(made.joints_rad) == 8
    assert not judge(made, p.action, p.side, p.speed).success


def test_a_wish_past_a_joint_limit_ends_the_episode(simulator):
    p = pattern(0)
    made = closed_loop.perform(closed_loop.stage_of(p, 0), lambda look, joints: joints + 9)
    assert made.stopped == "joint" and len(made.joints_rad) == 1


def test_what_is_no_number_is_refused_as_a_joint(simulator):
    p = pattern(0)
    made = closed_loop.perform(closed_loop.stage_of(p, 0), lambda look, joints: joints * np.nan)
    assert made.stopped == "joint"


def test_an_error_of_who_acts_is_not_taken_for_a_joint_limit(simulator):
    def broken(look, joints_rad):
        raise RobotError("the camera is off")

    with pytest.raises(RobotError, match="the camera is off"):
        closed_loop.perform(closed_loop.stage_of(pattern(0), 0), broken)


def test_only_a_ptae_with_its_own_kind_of_eye_can_act(simulator, trained):
    from dataclasses import replace

    from ptae_lite import vision
    from ptae_lite.acting import Actor
    from ptae_lite.models import PVAE, PVAEConfig

    other = replace(trained, model=PVAE(PVAEConfig(features=6, code=8, units=10)))
    with pytest.raises(ConfigError, match="only a PTAE can act in the loop, and this is a PVAE"):
        Actor(other, vision.make_autoencoder("separated", 2), "push red slowly")
    who = Actor(trained, vision.make_autoencoder("separated", 3).eval(), "push red slowly")
    with pytest.raises(ConfigError, match="makes 9 features of an image.* trained on 6"):
        closed_loop.perform(closed_loop.stage_of(pattern(0), 0), who)


def actor(trained, text, videos=None):
    """An actor, or one whose camera is swapped for stored pictures."""
    from ptae_lite import vision
    from ptae_lite.acting import Actor

    encoder = vision.make_autoencoder("separated", 2)
    who = Actor(trained, encoder.eval(), text)
    if videos is None:
        return who
    video = iter(videos)
    return lambda look, joints: who(lambda: next(video), joints)


def test_the_camera_steers_the_arm(simulator, trained):
    p = pattern(0)
    stage, text = closed_loop.stage_of(p, 0), sentence(p.meaning)
    stored = [np.zeros((120, 160, 3), dtype=np.uint8)] * 20

    def path(**camera):
        import torch

        torch.manual_seed(0)
        return closed_loop.perform(stage, actor(trained, text, **camera), limit=12).joints_rad

    assert (path() == path()).all()
    assert np.abs(path() - path(videos=stored)).max() > 1e-4


def test_the_sentence_steers_the_arm(simulator, trained):
    import torch

    stage = closed_loop.stage_of(pattern(0), 0)

    def path(text):
        torch.manual_seed(0)
        return closed_loop.perform(stage, actor(trained, text), limit=12).joints_rad

    said = [path(text) for text in ("push red slowly", "pull blue fast", None)]
    assert (said[0] != said[1]).any() and (said[0] != said[2]).any()
