"""The recording in data/: each sample its own motion, nothing shared, cubes pushed by physics."""

import colorsys
import json
import shutil
from collections import Counter
from types import SimpleNamespace

import numpy as np
import pytest

from ptae_lite import artefacts
from ptae_lite.data import frames
from ptae_lite.data.samples import load_samples, load_unseen
from ptae_lite.data.splits import SPLITS
from ptae_lite.errors import RecordingError
from ptae_lite.language import pattern, patterns
from ptae_lite.robot import arm, inverse, motions, recorder, scene
from ptae_lite.robot.recorder import record_sequence, samples_in_order
from ptae_lite.vision import probes


@pytest.fixture(scope="module")
def stored():
    """Arrays of all samples; those by frame are lists of one array a sample."""
    with np.load(artefacts.stored("recording/samples.npz")) as file:
        arrays = {name: file[name] for name in file.files}
    cuts = np.cumsum(arrays["frames"])[:-1]
    for name in ("pattern", "variation", "seed", "frames"):
        arrays[name] = arrays[name].tolist()
    for name in ("joints_rad", "cubes", "touched"):
        arrays[name] = np.split(arrays[name], cuts)
    return SimpleNamespace(**arrays)


@pytest.fixture(scope="module")
def first_images():
    return frames.Images([(index, variation, 0) for index, variation in samples_in_order()])


@pytest.fixture(scope="module")
def acted(stored):
    """For each sample: its pattern, the cubes' paths (named, other), and contacts with them."""
    clips = []
    for index, cubes, touched in zip(stored.pattern, stored.cubes, stored.touched, strict=True):
        p = pattern(index)
        sides = [0, 1] if p.side == "left" else [1, 0]
        clips.append((p, cubes[:, sides, :3].astype(float), touched[:, sides]))
    return clips


def test_there_are_864_samples_648_to_train_and_216_for_the_test(stored):
    assert list(zip(stored.pattern, stored.variation, strict=True)) == samples_in_order()
    splits = Counter(pattern(i).split for i in stored.pattern)
    assert splits == {"train": 648, "test": 216}
    assert stored.frames == [pattern(i).frames for i in stored.pattern]
    assert len(set(stored.seed)) == 864


def test_no_two_samples_share_a_trajectory_not_even_at_half_speed(stored):
    """The nearest two trajectories are more than 2 mrad (rms) apart, slow ones thinned."""
    thin = [q[::2] if len(q) == 100 else q for q in stored.joints_rad]
    flat = np.array(thin, dtype=float).reshape(864, -1)
    flat -= flat.mean(0)
    squares = (flat**2).sum(1)
    apart = squares[:, None] + squares - 2 * flat @ flat.T
    np.fill_diagonal(apart, np.inf)
    assert np.sqrt(apart.min() / flat.shape[1]) > 0.002


def test_no_first_image_is_in_both_splits(stored, first_images):
    seen = {"train": set(), "test": set()}
    for index, image in zip(stored.pattern, first_images, strict=True):
        seen[pattern(index).split].add(image.tobytes())
    assert [len(seen["train"]), len(seen["test"])] == [648, 216]
    assert not seen["train"] & seen["test"]


def test_the_named_cube_goes_where_the_action_says_and_the_other_stays(acted):
    for p, paths, _ in acted:
        gone = paths[-1, 0] - paths[0, 0]
        along = gone[:2] @ motions.DIRECTION[p.action]
        assert along >= 0.040
        assert np.linalg.norm(gone - [*np.multiply(along, motions.DIRECTION[p.action]), 0]) < 0.020
        assert np.linalg.norm(paths[:, 1] - paths[0, 1], axis=1).max() < 0.002


def test_no_cube_moves_before_it_is_touched(acted):
    for _, paths, touched in acted:
        assert touched[:, 0].any() and not touched[:, 1].any()
        first = touched[:, 0].argmax()
        assert first > 0
        assert np.linalg.norm(paths[:first] - paths[0], axis=2).max() < 0.0002


def test_cubes_stay_on_the_table(acted):
    for _, paths, _ in acted:
        assert np.abs(paths[..., 2] - scene.TABLE_TOP_M - scene.CUBE_EDGE_M / 2).max() < 0.002


def test_joints_stay_within_their_limits(stored):
    arm.check_limits(np.concatenate(stored.joints_rad))


def test_every_sequence_starts_and_ends_in_the_home_pose(stored):
    ends = np.array([q[[0, -1]] for q in stored.joints_rad])
    assert np.abs(ends - inverse.home_rad()).max() < 0.002


def hues(image):
    """Hue of the strongly coloured pixels of an image, 0 to 6 (red to red); else nan."""
    red, green, blue = np.moveaxis(image.astype(np.float32), -1, 0)
    high, low = image.max(-1).astype(np.float32), image.min(-1)
    spread = np.maximum(high - low, 1)
    hue = np.select(
        [high == red, high == green],
        [(green - blue) / spread % 6, (blue - red) / spread + 2],
        (red - green) / spread + 4,
    )
    return np.where(high - low > 0.6 * high, hue, np.nan)


@pytest.fixture(scope="module")
def coloured(first_images):
    """How many pixels of each colour every column of every first image has (864, 160)."""
    wanted = {
        name: 6 * colorsys.rgb_to_hsv(*rgba[:3])[0] for name, rgba in scene.COLOUR_RGBA.items()
    }
    counts = {name: np.zeros((len(first_images), 160), int) for name in wanted}
    for i, image in enumerate(first_images):
        seen = hues(image)
        for name, hue in wanted.items():
            counts[name][i] = (np.abs((seen - hue + 3) % 6 - 3) < 0.2).sum(0)  # 12 degrees
    return counts


@pytest.mark.slow
@pytest.mark.parametrize("name", scene.COLOUR_RGBA)
def test_every_first_image_shows_its_two_cubes_and_no_other_colour(stored, coloured, name):
    there = np.array([name in (pattern(i).left, pattern(i).right) for i in stored.pattern])
    counts = coloured[name].sum(1)
    assert counts[there].min() > 400
    assert counts[~there].max() == 0


def test_the_left_cube_of_a_pattern_is_the_left_one_in_the_image(stored, coloured):
    for i, index in enumerate(stored.pattern):
        p = pattern(index)
        left, right = (
            np.average(np.arange(160), weights=coloured[n][i]) for n in (p.left, p.right)
        )
        assert left < right - 20


def test_the_stored_recording_is_what_this_version_records(simulator, stored):
    """To a small fraction of the robot's step: another processor may round otherwise."""
    index = stored.pattern.index(80)
    made = record_sequence(pattern(80), 0)
    np.testing.assert_allclose(made.joints_rad, stored.joints_rad[index], atol=1e-3)
    np.testing.assert_allclose(made.cubes[..., :3], stored.cubes[index][..., :3], atol=1e-3)
    difference = made.images[0].astype(int) - frames.frame(80, 0, 0)
    assert np.abs(difference).mean() < 0.5


def test_stored_frames_are_the_chosen_ones():
    assert frames.stored_keys() == frames.choice()
    videos = frames.video_patterns()
    assert [patterns()[i].action_index for i in videos] == list(range(12))
    assert {patterns()[i].split for i in videos} == {"train"}


def test_a_frame_that_is_not_stored_is_refused_with_those_that_are():
    there = [t for index, variation, t in frames.stored_keys() if (index, variation) == (143, 5)]
    listed = ", ".join(map(str, there))
    with pytest.raises(RecordingError, match=f"frame 99 of pattern 143, .* of it: {listed}$"):
        frames.frame(143, 5, 99)


def test_an_eye_is_trained_on_each_third_frame_of_the_training_patterns(monkeypatch):
    read = []

    def load_sequence(folder, index, variation):
        read.append((index, variation))
        clip = np.zeros((pattern(index).frames, 2, 1, 3), np.uint8)
        clip[:, 0, 0] = np.arange(len(clip))[:, None]
        clip[:, 1, 0] = index, variation, 0
        return SimpleNamespace(images=clip)

    monkeypatch.setattr(recorder, "IMAGE", (2, 1, 3))
    monkeypatch.setattr(recorder, "load_sequence", load_sequence)
    monkeypatch.setattr(recorder, "check_ours", lambda folder, same_scene: None)
    images = frames.training_images("R")
    wanted = [(i, v) for i, v in samples_in_order() if pattern(i).split == "train"]
    assert read == wanted
    whole = [(t, i, v) for i, v in wanted for t in range(0, pattern(i).frames, 3)]
    assert [(im[0, 0, 0], *im[1, 0, :2]) for im in images] == whole


def test_the_stored_recording_loads_with_its_features():
    samples = load_samples()
    sizes = {name: len(samples.split(name)) for name in SPLITS}
    assert sizes == {"train": 648, "test": 216, "held_out": 96, "fit": 552}
    assert samples.features.shape == (864, 100, 30)
    inside = np.arange(100) < samples.frames[:, None]
    for array in (samples.joints, samples.features, samples.cubes):
        assert np.isfinite(array).all() and not array[~inside].any()
    assert samples.features[inside].std(0).min() > 0


def test_a_recording_is_read_before_an_eye_has_looked_at_it(tmp_path):
    about = {"format": recorder.FORMAT, "fingerprint": "0"}
    (tmp_path / "recording.json").write_text(json.dumps(about))
    with pytest.raises(RecordingError, match="samples.npz is missing; make it .*ptae_lite record"):
        load_unseen(tmp_path)
    shutil.copy(artefacts.stored("recording/samples.npz"), tmp_path)
    unseen, seen = load_unseen(tmp_path), load_samples()
    assert unseen.features.shape == (864, 100, 0)
    for name in ("joints", "cubes", "touched", "frames", "pattern", "variation"):
        np.testing.assert_array_equal(getattr(unseen, name), getattr(seen, name))
    with pytest.raises(RecordingError, match="features.npz is missing; make it .*lite features"):
        load_samples(tmp_path)


def test_a_linear_read_out_of_first_frames_knows_colours_and_places():
    samples = load_samples("recording")
    first, test = probes.first(samples.features), samples.split("test")
    hits = []
    for labels in probes.colours(samples).values():
        read = probes.fit_classifier(first[samples.split("train")], labels[samples.split("train")])
        hits.append(read.labels(first[test]) == labels[test])
    assert np.mean(hits[0] & hits[1]) >= 0.99
    assert probes.place_errors_mm(samples, first, samples.cubes[:, 0])["distance"] <= 4
