"""Corrected clips: recorded whole or not at all, resumed, read back; of training patterns only."""

import json
import shutil

import numpy as np
import pytest

from ptae_lite.data import clips as files
from ptae_lite.data.clips import Clips, load_clips
from ptae_lite.data.splits import SPLITS
from ptae_lite.errors import RecordingError
from ptae_lite.experiments import corrections
from ptae_lite.language import patterns
from ptae_lite.robot import arm


@pytest.fixture(scope="module")
def encoder():
    from ptae_lite import artefacts, vision

    return vision.load_autoencoder(artefacts.stored("weights/cae.safetensors"))


@pytest.fixture(scope="module")
def folder(simulator, tmp_path_factory):
    """Three clips of fast patterns."""
    made, few = tmp_path_factory.mktemp("clips") / "new", jobs()
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(corrections, "jobs_in", lambda *_: few)
        corrections.record(made, workers=1)
    return made


def jobs():
    every = corrections.jobs_in("train")
    return [job for job in every if patterns()[job[0] // 6].frames == 50][:3]


def clip(sample=0, frames=4, **more):
    """A made-up clip."""
    rng = np.random.default_rng(sample)
    one = {"sample": sample, "pattern": sample // 6, "event": 2, "pushed": -1, "seed": 100_000,
           "success": True, "frames": frames, "kind": "named"} | more  # fmt: skip
    sizes = {"features": (30,), "joints_rad": (5,), "goal_m": (3,), "cubes": (2, 7)}
    shown = {name: rng.normal(size=(frames, *size)).astype(np.float32)
             for name, size in sizes.items()}  # fmt: skip
    return Clips(**{name: np.array([value]) for name, value in one.items()}, **shown)


def same(one: Clips, other: Clips) -> bool:
    return all((a == vars(other)[name]).all() for name, a in vars(one).items())


def test_a_folder_of_clips_is_read_back(folder):
    every = load_clips(folder)
    assert sorted(path.name for path in folder.iterdir()) == [
        "clips", "clips.npz", "recording.json"
    ]  # fmt: skip
    assert every.sample.tolist() == [sample for sample, _ in jobs()]
    assert every.seed.tolist() == [100_000 + 1_000 * r + s for s, r in jobs()]
    frames = int(every.frames.sum())
    shapes = {name: getattr(every, name).shape for name in files.OF_FRAMES}
    assert shapes == {"features": (frames, 30), "joints_rad": (frames, 5), "goal_m": (frames, 3),
                      "cubes": (frames, 2, 7)}  # fmt: skip
    assert all(getattr(every, name).dtype == np.float32 for name in files.OF_FRAMES)
    assert (every.frames > 40).all() and set(every.kind) <= {*corrections.CUBES, "none"}


def test_clips_that_are_still_being_recorded_can_be_read(folder, tmp_path):
    shutil.copytree(folder / "clips", tmp_path / "clips")
    (tmp_path / "clips" / "s001_r0.npz.1.part").write_bytes(b"half")
    found = load_clips(tmp_path)
    every = load_clips(folder)
    order = np.argsort(found.sample)
    assert found.sample[order].tolist() == sorted(every.sample.tolist())


def test_the_same_clip_gives_the_same_bytes(folder, encoder):
    assert same(corrections.record_clip(encoder, *jobs()[0]), load_clips(folder).where(
        np.arange(3) == 0))  # fmt: skip


def test_a_stopped_recording_goes_on_with_what_is_missing_only(folder, tmp_path, monkeypatch):
    few = jobs()
    monkeypatch.setattr(corrections, "jobs_in", lambda *_: few)
    again = tmp_path / "again"
    shutil.copytree(folder, again)
    (again / "clips.npz").unlink()
    gone = corrections.path_of(again, *few[1])
    gone.unlink()
    (again / "clips" / "s999_r0.npz.1.part").write_bytes(b"half")
    times = {path.name: path.stat().st_mtime_ns for path in again.glob("clips/*.npz")}
    made = []
    corrections.record(again, workers=1, progress=lambda runs: made.extend(runs) or ())
    assert len(made) == 1 and same(load_clips(again), load_clips(folder))
    assert not list(again.rglob("*.part"))
    assert times.items() <= {p.name: p.stat().st_mtime_ns for p in again.glob("clips/*")}.items()


def test_the_goal_is_what_the_planner_wants_and_not_the_noise(folder, encoder):
    noisy = load_clips(folder)
    calm = [corrections.record_clip(encoder, *job, "added-noise") for job in jobs()]
    calm = files.join(calm)
    assert (calm.kind == noisy.kind).all() and (calm.event == noisy.event).all()

    def miss_mm(clips):
        """How far the hand is, in the next frame, from where the planner wanted it."""
        tips, ends = arm.fingertip(clips.joints_rad), np.cumsum(clips.frames)[:-1] - 1
        far = 1000 * np.linalg.norm(clips.goal_m[:-1] - tips[1:], axis=1)
        driven = np.repeat(clips.pushed < 0, clips.frames)[:-1]
        driven[ends] = False
        return far[driven]

    assert np.median(miss_mm(calm)) < 1.5 < 3 < np.median(miss_mm(noisy))


def test_a_control_has_no_disturbance(encoder, simulator):
    disturbed = next(job for job in jobs() if corrections.record_clip(encoder, *job).event[0] >= 0)
    made = corrections.record_clip(encoder, *disturbed, "disturbances")
    assert made.event.tolist() == made.pushed.tolist() == [-1] and made.kind.tolist() == ["none"]
    assert made.success.all()


def test_only_training_patterns_are_recorded_and_from_seeds_of_their_own():
    for split in ("train", "fit"):
        every = corrections.jobs_in(split)
        assert len(every) == len(set(every)) == 12 * len(SPLITS[split])
        assert {sample // 6 for sample, _ in every} == set(SPLITS[split])
        assert {round_ for _, round_ in every[: len(every) // 2]} == {0}
    assert not {sample // 6 for sample, _ in corrections.jobs_in("train")} & set(SPLITS["test"])
    assert min(corrections.FIRST_SEED + s for s, _ in corrections.jobs_in("train")) > 10_000
    part = {patterns()[sample // 6].action for sample, _ in corrections.jobs_in("train", 24)}
    assert part == {"push", "pull", "slide"}  # a part is a fair choice


@pytest.mark.parametrize(
    ("found", "message"),
    [
        ({"notes.txt": "mine"}, "is not empty and holds no corrected clips"),
        ({"recording.json": "{"}, "other settings, or is no folder of corrected clips"),
        ({"recording.json": json.dumps({"format": files.FORMAT})}, "other settings"),
    ],
)
def test_a_folder_of_something_else_is_refused_and_left_alone(simulator, tmp_path, found, message):
    for name, text in found.items():
        (tmp_path / name).write_text(text)
    with pytest.raises(RecordingError, match=message):
        corrections.record(tmp_path, workers=1)
    assert {path.name: path.read_text() for path in tmp_path.iterdir()} == found


def test_clips_without_noise_are_not_mixed_with_others(folder):
    with pytest.raises(RecordingError, match="other settings"):
        corrections.record(folder, workers=1, without="added-noise")


def test_clips_of_some_samples_and_stacked():
    every = files.join([clip(6, 4), clip(700, 2), clip(7, 3)])
    mine = every.of(np.array([6, 7]))
    assert mine.sample.tolist() == [6, 7] and mine.frames.tolist() == [4, 3] and len(mine) == 2
    assert (mine.goal_m[4:] == clip(7, 3).goal_m).all()
    stacked = mine.stacked("features")
    assert stacked.shape == (2, 4, 30) and not stacked[1, 3:].any()
    assert (stacked[1, :3] == clip(7, 3).features).all()


@pytest.mark.parametrize("damage", ["cut short", "empty", "too few frames"])
def test_a_damaged_file_is_named(unchecked, tmp_path, damage):
    path = tmp_path / files.CLIPS
    made = clip(0, 4)
    if damage == "too few frames":
        vars(made)["goal_m"] = made.goal_m[:3]
    files.write_clips(path, made)
    content = path.read_bytes()
    path.write_bytes({"cut short": content[:500], "empty": b""}.get(damage, content))
    with pytest.raises(RecordingError, match="clips.npz.*delete it and record again"):
        load_clips(tmp_path)


def test_a_folder_without_clips_says_how_to_record(tmp_path):
    with pytest.raises(RecordingError, match="no corrected clips.*python -m ptae_lite corrections"):
        load_clips(tmp_path)
    with pytest.raises(RecordingError, match="no clips to join"):
        files.join([])


@pytest.mark.parametrize("without", [None, *corrections.WITHOUT])
def test_the_command_records_what_it_is_asked_for(folder, tmp_path, monkeypatch, without):
    from ptae_lite.__main__ import main

    def record(out, split, *, count, workers, without, progress):
        shutil.copytree(folder, out)
        asked.append((split, count, workers, without))

    asked = []
    monkeypatch.setattr(corrections, "record", record)
    options = ["--without", without] if without else []
    out = ["--out", str(tmp_path / "made"), "--count", "3", "--workers", "1"]
    assert main(["corrections", "--split", "fit", *out, *options]) == 0
    assert asked == [("fit", 3, 1, without)]
