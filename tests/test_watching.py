"""The policy that watches: its kinematics, its parts, its training, and how it acts and tells."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from ptae_lite import artefacts
from ptae_lite.data import demonstrations
from ptae_lite.data.clips import Clips
from ptae_lite.data.samples import load_samples
from ptae_lite.data.scaling import fit_scaling
from ptae_lite.data.signals import Source, build
from ptae_lite.errors import ConfigError
from ptae_lite.evaluation import respond
from ptae_lite.language import COLOURS, SYNONYMS, WORD_INDEX, decode, patterns, sentence
from ptae_lite.models import PTAE, PTAEConfig, checkpoint, kinematics
from ptae_lite.models.checkpoint import Trained
from ptae_lite.models.watching import KINDS, Watcher, WatcherConfig, one_of_each
from ptae_lite.robot import arm, inverse
from ptae_lite.watching_actor import WatchingActor
from ptae_lite.watching_training import (
    Prepared,
    WatchingRecipe,
    clip_codes,
    fit_teller,
    numbers,
    queries,
    train,
)

TINY = PTAEConfig(hidden=16, heads=2, feed_forward=32, decoder_units=12, dropout=0.0,
                  pad_still_frame=False, freeze_video=True, condition_on_code=True)  # fmt: skip
EIGHT = [0, 1, 60, 190, 310, 440, 570, 700]  # slow and fast, all actions, both sides


@pytest.fixture(scope="module")
def recording():
    return load_samples()


@pytest.fixture(scope="module")
def base(recording):
    """A tiny PTAE with random weights, and the scaling of the recording."""
    torch.manual_seed(3)
    scaling = fit_scaling(recording, recording.split("train"))
    about = {"encoder": recording.encoder, "split": "train", "experiment": "b" * 64}
    return Trained(PTAE(TINY).eval(), scaling, about)


@pytest.fixture(scope="module")
def learned(recording, base):
    """A policy that was trained on eight clips."""
    recipe = WatchingRecipe(
        meaning_steps=1500, colour_steps=100, place_steps=300, plan_steps=250, teller_steps=100,
        clips=4, hand_noise_m=0.0, frames=64, feature_noise=0.0, learning_rate=1e-2,
    )  # fmt: skip
    return train(base, demonstrations.recorded(recording, EIGHT), recipe)


@pytest.fixture(scope="module")
def shown(recording, base):
    return Prepared.of(demonstrations.recorded(recording, EIGHT), base.scaling)


def test_the_hand_is_where_the_robot_says():
    joints = np.random.default_rng(0).uniform(arm.LOWER_RAD, arm.UPPER_RAD, (4, 50, 5))
    ours = kinematics.fingertip(torch.tensor(joints))
    theirs = arm.fingertip(joints.reshape(-1, 5)).reshape(4, 50, 3)
    np.testing.assert_allclose(ours.numpy(), theirs, atol=1e-12)
    home = kinematics.fingertip(torch.tensor(np.array(inverse.home_rad())))
    np.testing.assert_allclose(home.numpy(), arm.HOME_TIP_M, atol=1e-4)


def test_the_gradient_of_the_hand_is_the_arms_jacobian():
    joints = torch.tensor(inverse.REST_RAD, requires_grad=True)
    assert torch.autograd.gradcheck(kinematics.fingertip, joints)


def test_recorded_clips_say_where_the_hand_was_a_frame_later(recording):
    clips = demonstrations.recorded(recording, EIGHT)
    for i, sample in enumerate(EIGHT):
        end = recording.frames[sample]
        hand = arm.fingertip(recording.joints[sample, :end])
        np.testing.assert_allclose(clips.goal_m[i, : end - 1], hand[1:], atol=1e-6)
        np.testing.assert_allclose(clips.goal_m[i, end:], hand[-1:].repeat(140 - end, 0), atol=1e-6)
        at, side = clips.touch[i], clips.side[i]
        assert (
            recording.touched[sample, at, side] and not recording.touched[sample, :at, side].any()
        )
        assert (clips.remembered_m[i, at:] == recording.cubes[sample, at - 1, side, :2]).all()


def test_a_corrected_clip_remembers_the_place_after_the_move(recording):
    """The named cube is moved in frame 5 and touched in frame 20; then it goes with the hand."""
    frames, side = 40, 0
    cubes = np.zeros((frames, 2, 7), np.float32)
    cubes[5:, side, 0] = 0.03
    cubes[20:, side, 0] += np.linspace(0.002, 0.06, 20)
    one = Clips(
        sample=np.array([0]), pattern=np.array([0]), kind=np.array(["named"]), event=np.array([5]),
        pushed=np.array([-1]), success=np.array([True]), seed=np.array([100_000]),
        frames=np.array([frames]), features=np.ones((frames, 30), np.float32),
        joints_rad=np.zeros((frames, 5), np.float32), goal_m=np.zeros((frames, 3), np.float32),
        cubes=cubes,
    )  # fmt: skip
    assert patterns()[0].side == "left"
    clip = demonstrations.corrected(one)
    assert clip.touch.tolist() == [20] and clip.features.shape == (1, 140, 30)
    np.testing.assert_allclose(clip.remembered_m[0, :, 0], [0] * 5 + [0.03] * 135, atol=1e-6)
    assert len(demonstrations.corrected(replace(one, success=np.array([False])))) == 0


def test_shapes_and_gradients_reach_every_part():
    torch.manual_seed(0)
    model = Watcher(WatcherConfig(ptae=TINY))
    task = torch.tensor([[0, 1, 1], [1, 2, 0]])
    video, hand = torch.randn(2, 7, 30), torch.randn(2, 7, 3)
    read = model.read(task, video)
    wish, kept, memory = model.follow(task, read, hand)
    assert read.shape == kept.shape == (2, 7, 2) and wish.shape == (2, 7, 3)
    assert memory.place_m.shape == (2, 2)
    assert one_of_each(task).sum(1).tolist() == [len(KINDS)] * 2
    code = model.code_of_sentence(torch.zeros(2, 6, dtype=torch.long))
    words = model.tell(model.watch(torch.randn(2, 9, 35)), torch.tensor([9.0, 9.0]), video[:, 0])
    scores = sum(part.square().mean() for part in model.meaning(code))
    (wish.square().mean() + words.square().mean() + scores).backward()
    silent = [n for n, p in model.named_parameters() if p.grad is None or not p.grad.abs().sum()]
    # the joints of the PTAE's own decoder are not used, and softmax does not see the keys' bias
    assert {name for name in silent if "ptae.action" not in name} <= {
        "ptae.encoder.attention.key.bias"
    }


def test_step_by_step_it_wishes_what_it_wishes_for_the_whole_clip(learned, shown):
    model, task = learned.model, shown.task[:2]
    with torch.no_grad():
        read = model.read(task, shown.features[:2])
        whole, places, _ = model.follow(task, read, shown.hand_m[:2])
        memory = None
        for t in range(30):
            wish, kept, memory = model.follow(
                task, read[:, t : t + 1], shown.hand_m[:2, t : t + 1], memory
            )
            torch.testing.assert_close(wish[:, 0], whole[:, t])
            torch.testing.assert_close(kept[:, 0], places[:, t])


def test_a_blind_one_sees_the_first_image_only_and_does_not_feel_its_hand(shown):
    torch.manual_seed(0)
    model, task = Watcher(WatcherConfig(ptae=TINY, blind=True)), shown.task
    read, hand = model.read(task, shown.features), shown.hand_m
    wish, kept, _ = model.follow(task, read, hand)
    other = torch.cat([read[:, :1], torch.randn_like(read[:, 1:])], dim=1)
    torch.testing.assert_close(wish, model.follow(task, other, torch.randn_like(hand))[0])
    torch.testing.assert_close(kept, read[:, :1].expand_as(kept))


def test_it_learns_eight_clips(learned, shown):
    model = learned.model
    with torch.no_grad():
        asked = [model.code_of_sentence(queries(one)) for one in shown.sentences.unbind(1)]
        decided = [model.understand(code, shown.features[:, 0]) for code in asked]
        read = model.read(shown.task, shown.features)
        wish, kept, _ = model.follow(shown.task, read, shown.hand_m)
    assert all((one == shown.task).all() for one in decided)
    free = shown.before_touch
    assert (read - shown.remembered_m)[free].norm(dim=1).mean() < 0.002
    inside = torch.arange(wish.shape[1]) < shown.frames[:, None]
    assert (wish - shown.goal_m)[inside].norm(dim=1).mean() < 0.010
    assert (kept - shown.remembered_m)[inside].norm(dim=1).mean() < 0.005


@pytest.fixture(scope="module")
def teller(recording):
    """A policy on a trained PTAE that has learned to tell of eight clips, and these clips."""
    known = checkpoint.load(artefacts.stored("weights/one_look_policy_seed0.safetensors"))
    torch.manual_seed(0)
    model = Watcher(WatcherConfig(ptae=known.model.config)).eval()
    model.ptae.load_state_dict(known.model.state_dict())
    shown = Prepared.of(demonstrations.recorded(recording, EIGHT), known.scaling)
    fit_teller(model, shown, WatchingRecipe(teller_steps=300, frames=32))
    return model, shown


def test_it_tells_the_speed_by_the_duration(teller):
    """The same frames, said to have taken longer, are said to be slow."""
    model, shown = teller
    with torch.no_grad():
        code, first = model.watch(shown.keys[:, :50]), shown.features[:, 0]
        said = [model.tell(code, torch.full((8,), t), first).argmax(2)[:, 2] for t in (50.0, 100.0)]
    slow = {WORD_INDEX[word] for word in ("slowly", SYNONYMS["slowly"])}
    assert [[word in slow for word in one.tolist()] for one in said] == [[False] * 8, [True] * 8]


def test_it_says_no_colour_that_it_does_not_see(teller):
    """Whatever PTAE would say, where only cyan and violet cubes stand it says cyan or violet."""
    model, shown = teller

    def colours(first):
        scores = torch.full((len(first), 2, len(COLOURS)), -100.0)
        scores[:, 0, COLOURS.index("cyan")] = scores[:, 1, COLOURS.index("violet")] = 0
        return scores

    code, first = clip_codes(model, shown), shown.features[:, 0]
    model.colours.forward = colours
    with torch.no_grad():
        words = model.tell(code, shown.frames.float(), first).argmax(2)
    del model.colours.forward
    said = {decode(one).split()[1] for one in words.tolist()}
    assert said <= {"cyan", "violet", SYNONYMS["cyan"], SYNONYMS["violet"]}


def test_the_side_is_where_the_named_colour_is_more_probable(learned, shown):
    """Colours decide, not the pairs of the training: the same sentence, the cubes exchanged."""
    model = learned.model
    with torch.no_grad():
        code = model.code_of_sentence(queries(shown.sentences[:, 0]))
        seen = model.colours(shown.features[:, 0])
        model.colours.forward = lambda first: seen.flip(1)
        other = model.understand(code, shown.features[:, 0])
        del model.colours.forward
    assert (other[:, 0] == 1 - shown.task[:, 0]).all()
    assert (other[:, 1:] == shown.task[:, 1:]).all()


def test_the_ptae_below_answers_as_before(learned, base, recording):
    source = Source(base.dataset(recording))
    for signal in ("describe", "repeat action"):
        before = respond(base, source, EIGHT, signal)
        after = respond(learned, source, EIGHT, signal)
        torch.testing.assert_close(before.words, after.words)
        torch.testing.assert_close(before.joints, after.joints)


def test_it_comes_back_from_its_file(learned, shown, tmp_path):
    checkpoint.save(tmp_path / "w.safetensors", learned)
    again = checkpoint.load(tmp_path / "w.safetensors")
    assert again.model.config == learned.model.config and again.about["clips"] == 8
    with torch.no_grad():
        codes = (one.model.watch(shown.keys[:, :50]) for one in (learned, again))
        torch.testing.assert_close(*codes)


class Room(torch.nn.Module):
    """An encoder whose features are those of a recorded clip, frame after frame."""

    def __init__(self, features):
        super().__init__()
        self.rows = iter(torch.from_numpy(features))

    def encode(self, images):
        return next(self.rows)[None]


def act(trained, recording, sample, frames=20):
    shown, features = patterns()[recording.pattern[sample]], recording.features[sample]
    actor = WatchingActor(trained, Room(features), sentence(shown.meaning))
    image = np.zeros((120, 160, 3), np.uint8)
    wishes = [actor(lambda: image, q) for q in recording.joints[sample, :frames]]
    return actor, np.array(wishes)


def test_it_acts_the_same_way_twice_and_inside_the_joints_limits(learned, recording):
    actor, once = act(learned, recording, EIGHT[2])
    np.testing.assert_array_equal(once, act(learned, recording, EIGHT[2])[1])
    arm.check_limits(once)
    shown = patterns()[recording.pattern[EIGHT[2]]]
    assert actor.task == (shown.side, shown.action, shown.speed)
    assert numbers(shown) == actor.numbers[0].tolist()
    hand = arm.fingertip(once)[:-1] - arm.fingertip(recording.joints[EIGHT[2], 1:20])
    assert np.linalg.norm(hand, axis=1).mean() < 0.015
    scaling = learned.scaling
    seen = np.concatenate([
        scaling.features(recording.features[EIGHT[2], :20]),
        scaling.joints(recording.joints[EIGHT[2], :20]),
    ], axis=1)  # fmt: skip
    with torch.no_grad():
        code = learned.model.watch(torch.tensor(seen[None], dtype=torch.float32))
        first = torch.tensor(seen[:1, :30], dtype=torch.float32)
        words = learned.model.tell(code, torch.tensor([20.0]), first)
    assert actor.describe() == decode(words[0].argmax(1).tolist())


def test_a_frozen_one_does_not_see_what_comes(base, recording):
    torch.manual_seed(1)
    fresh = replace(base, model=Watcher(WatcherConfig(ptae=TINY)).eval())
    features = recording.features[EIGHT[0]].copy()
    changed = features.copy()
    changed[1:] += 1.0
    asked = sentence(patterns()[recording.pattern[EIGHT[0]]].meaning)
    image = np.zeros((120, 160, 3), np.uint8)

    def wishes(rows, frozen):
        actor = WatchingActor(fresh, Room(rows), asked, frozen=frozen)
        return np.array([actor(lambda: image, q) for q in recording.joints[EIGHT[0], :10]])

    np.testing.assert_array_equal(wishes(features, True), wishes(changed, True))
    assert not np.allclose(wishes(features, False), wishes(changed, False))


def test_what_is_no_watching_policy_is_refused(base, recording):
    with pytest.raises(ConfigError, match="not a policy that watches"):
        WatchingActor(base, torch.nn.Identity(), "push red slowly")
    padded = replace(base, model=PTAE(replace(TINY, pad_still_frame=True)))
    with pytest.raises(ConfigError, match="without pad_still_frame"):
        train(padded, demonstrations.recorded(recording, EIGHT), WatchingRecipe())
    with pytest.raises(ConfigError, match="plan_steps is 0"):
        WatchingRecipe(plan_steps=0)
    with pytest.raises(ConfigError, match="units is 0"):
        WatcherConfig(units=0)


def test_a_batch_of_the_four_tasks_is_answered(learned, recording):
    source = Source(learned.dataset(recording))
    batch = build(source, torch.tensor(EIGHT), torch.arange(8) % 5, torch.arange(8))
    answer = learned.model(batch)
    assert answer.joints.shape == (8, 99, 5) and answer.words.shape[:2] == (8, 4)
