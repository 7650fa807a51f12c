"""Records corrected clips: the planner acts, is disturbed, and shows the way back from where it is.

The motions are new draws of training patterns, from seeds of their own. In three quarters of the
clips cubes are moved before the hand touches them, in a quarter the hand is pushed. Besides, smooth
noise is added to where the hand is driven, but not to `goal_m`, the planner's answer to the state
that results (DART, Laskey et al. 2017, arXiv 1703.09327). Without noise a clip would hardly show
what to do off the path.

A recording is a folder::

    recording.json     the format, the fingerprint of the scene, and all settings
    clips/s123_r0.npz  one clip, of a sample's pattern
    clips.npz          all clips, written when they are there
"""

from __future__ import annotations

import json
from argparse import ArgumentParser
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import NamedTuple

import numpy as np
import torch
from joblib import Parallel, delayed

from ptae_lite import artefacts, vision
from ptae_lite.data import clips as files
from ptae_lite.data.clips import Clips
from ptae_lite.data.splits import SPLITS
from ptae_lite.errors import RecordingError
from ptae_lite.files import PART, atomic_write, file_lock
from ptae_lite.language import pattern
from ptae_lite.robot import closed_loop, corrections, inverse, motions
from ptae_lite.robot.closed_loop import Setting
from ptae_lite.robot.corrections import Planner
from ptae_lite.robot.disturbances import Disturbance, draw_places, draw_push
from ptae_lite.robot.recorder import fingerprint
from ptae_lite.robot.scene import TABLE_TOP_M, pybullet

FIRST_SEED, ROUND_SEEDS = 100_000, 1_000  # the recording has the seeds 0 to 863
ROUNDS = 2  # clips of each sample's pattern
WITHOUT = ("added-noise", "disturbances")  # what a control can be recorded without
KINDS = ((0.60, True, False), (0.75, True, True), (0.85, False, True), (1.0, False, False))
# cumulative shares of the clips: are cubes moved, is the hand pushed?
CUBES = {"named": 0.35, "both": 0.50, "other": 0.15}  # which, if any
MOVED_M, PUSHED_M = (0.010, 0.045), (0.025, 0.060)
AT_CLOCK = (3, 20)  # slow frames at which it happens: before the hand comes down
PUSH_CLOCK, HELD_CLOCK = 6, (0, 26)  # slow frames in which the hand is driven off, and held there
NOISE_M = np.array([0.012, 0.012, 0.006])
CALM_SHARE, CALM = 0.25, 0.3  # of the clips; their noise is so much smaller
NOISE_CLOCK = 9.0  # slow frames in which the noise forgets
STROKE_NOISE = 0.2  # near the cube
LOWEST_M = TABLE_TOP_M + 0.008


def settings(split: str, without: str | None, encoder_file) -> dict:
    """What the clips of a folder depend on."""
    names = ("GAIN", "HURRY", "LARGEST_M", "LARGEST_UP_M", "CLOSE_M", "FAR_M", "READY_M")
    rule = {name: getattr(corrections, name) for name in names}
    return {
        "format": files.FORMAT, "fingerprint": fingerprint(),
        "encoder": artefacts.sha256(encoder_file),
        "split": split, "without": without, "planner": rule, "kinds": [list(one) for one in KINDS],
        "cubes": CUBES, "moved_m": list(MOVED_M), "pushed_m": list(PUSHED_M),
        "at_clock": list(AT_CLOCK), "push_clock": PUSH_CLOCK, "held_clock": list(HELD_CLOCK),
        "noise_m": NOISE_M.tolist(),
        "noise_clock": NOISE_CLOCK, "calm": [CALM_SHARE, CALM], "stroke_noise": STROKE_NOISE,
        "first_seed": FIRST_SEED,
    }  # fmt: skip


class NoisyPlanner(Planner):
    """The planner, driven off its way by noise and looking at every frame.

    It keeps what it saw: `images`, `joints` and `cubes`, and what it then wanted without noise:
    `goals`.
    """

    def __init__(self, pattern, variation, rng, noise_m):
        super().__init__(pattern, variation)
        self._rng, self._noise_m = rng, noise_m
        self._step = motions.CLOCK[-1] / (pattern.frames - 1)
        self._unit, self._deviation = np.zeros(3), np.zeros(3)
        self.images, self.goals, self.joints, self.cubes = [], [], [], []

    def __call__(self, look, joints_rad) -> np.ndarray:
        self.images.append(look())
        self.joints.append(joints_rad)
        self.cubes.append(self._cubes)
        wish = super().__call__(look, joints_rad)
        self.goals.append(self.goal_m)
        if not self._noise_m.any():
            return wish
        aim = self.goal_m + self._noise()
        aim[2] = max(aim[2], LOWEST_M)
        return inverse.towards(aim, joints_rad)

    def _noise(self):
        """What to add, so that the hand is off its path by smooth noise though the planner acts."""
        forget = np.exp(-self._step / NOISE_CLOCK)
        fresh = self._rng.standard_normal(3)
        self._unit = forget * self._unit + np.sqrt(1 - forget**2) * fresh
        stroke, up = self._variation.clock[2], self._variation.clock[4]
        times = [0, 2, stroke - 12, stroke - 3, up, up + 6, 86, 94]
        size = np.interp(self.phase.clock, times,
                         [0, 1, 1, STROKE_NOISE, STROKE_NOISE, 1, 1, 0])  # fmt: skip
        before, self._deviation = self._deviation, size * self._noise_m * self._unit
        return self._deviation - (1 - corrections.GAIN) ** self._step * before


class Acted(NamedTuple):
    """Who acted in a clip and what it saw, what happened, and which cubes were moved."""

    planner: NoisyPlanner
    episode: closed_loop.Episode
    kind: str
    disturbance: Disturbance


def seed_of(sample: int, round_: int) -> int:
    """The seed of a clip's motion and of all that happens in it."""
    return FIRST_SEED + ROUND_SEEDS * round_ + sample


def disturbance_of(sample: int, round_: int) -> tuple[str, Disturbance]:
    """Which cubes are moved in a clip (`none` if none is), and all that disturbs it."""
    seed = seed_of(sample, round_)
    asked, rng = pattern(sample // motions.VARIATIONS), np.random.default_rng([77, seed, 0])
    return _draw(rng, asked, motions.draw(seed))


def act_clip(sample: int, round_: int, without: str | None = None) -> Acted:
    """Act one clip with the camera on. On one machine, the same arguments give the same bytes.

    Args:
        sample: in whose pattern the clip is made.
        round_: 0 for the first clip of the sample, 1 for the second.
        without: `added-noise`, `disturbances` or None.
    """
    asked, seed = pattern(sample // motions.VARIATIONS), seed_of(sample, round_)
    drawn, rng = motions.draw(seed), np.random.default_rng([77, seed, 1])
    nothing = ("none", Disturbance())
    kind, what = nothing if without == "disturbances" else disturbance_of(sample, round_)
    calm = CALM if rng.random() < CALM_SHARE else 1.0
    planner = NoisyPlanner(asked, drawn, rng, NOISE_M * (0 if without == "added-noise" else calm))
    stage = Setting((asked.left, asked.right), drawn.places_m, drawn.yaws_rad)
    return Acted(planner, closed_loop.perform(stage, planner, disturbance=what), kind, what)


def record_clip(encoder, sample: int, round_: int, without: str | None = None) -> Clips:
    """One clip with the features of its images; see `act_clip`."""
    asked = pattern(sample // motions.VARIATIONS)
    planner, episode, kind, disturbance = act_clip(sample, round_, without)
    verdict = closed_loop.judge(episode, asked.action, asked.side, asked.speed)

    def column(value, kind=None):
        return np.array([value], dtype=kind)

    return Clips(
        sample=column(sample), pattern=column(asked.index), kind=column(kind, "U5"),
        event=column(-1 if disturbance.places_m is None else episode.event),
        pushed=column(-1 if disturbance.push_m is None else episode.event),
        success=column(verdict.success), seed=column(seed_of(sample, round_)),
        frames=column(len(planner.images)),
        features=vision.encode_images(encoder, np.stack(planner.images)),
        joints_rad=np.array(planner.joints, np.float32),
        goal_m=np.array(planner.goals, np.float32), cubes=np.array(planner.cubes, np.float32),
    )  # fmt: skip


def _draw(rng, asked, drawn) -> tuple[str, Disturbance]:
    """Which cubes are moved, and the disturbance."""
    scale = (asked.frames - 1) / motions.CLOCK[-1]
    frame = round(rng.uniform(*AT_CLOCK) * scale)
    chance = rng.random()
    move, push = next((move, push) for share, move, push in KINDS if chance <= share)
    kind, places, push_m, now = "none", None, None, drawn
    if move:
        which = str(rng.choice(list(CUBES), p=list(CUBES.values())))
        places = draw_places(rng, asked, drawn, which, *MOVED_M)
        if places is not None:
            kind, now = which, replace(drawn, places_m=places)
    if push:
        at_m = motions.fingertip_path(asked, drawn)[frame]
        push_m = draw_push(rng, asked, now, at_m, *PUSHED_M)
    return kind, Disturbance(
        frame, places_m=places, push_m=push_m, push_frames=round(PUSH_CLOCK * scale),
        held_frames=round(rng.uniform(*HELD_CLOCK) * scale),
    )  # fmt: skip


def jobs_in(split: str, count: int | None = None) -> list[tuple[int, int]]:
    """(sample, round) of all clips, mixed, so that a part is a fair choice of the patterns."""
    own = [
        motions.sample_seed(index, variation)
        for index in SPLITS[split] for variation in range(motions.VARIATIONS)
    ]  # fmt: skip
    mixed = np.random.default_rng(5).permutation(own).tolist()
    return [(sample, round_) for round_ in range(ROUNDS) for sample in mixed][:count]


def path_of(folder, sample: int, round_: int) -> Path:
    """The file of one clip."""
    return Path(folder) / "clips" / f"s{sample:03d}_r{round_}.npz"


def record(
    folder, split: str = "train", *, count: int | None = None, workers: int = 2,
    without: str | None = None, progress=lambda done: done,
) -> Path:  # fmt: skip
    """Record the corrected clips that are missing in a folder.

    Args:
        folder: made if it does not exist.
        split: `train` or `fit`; no other patterns may be learned from.
        count: how many clips; all (two of each sample's pattern) if None.
        workers: number of processes.
        without: see `record_clip`.
        progress: wraps the iterator over finished clips, as `tqdm` does.

    Raises:
        RecordingError: `folder` holds something else, or clips with other settings.
        FileError: another run records into it, or it cannot be written.
        RobotError: PyBullet is not installed.
    """
    folder, encoder_file = Path(folder), artefacts.stored("weights/cae.safetensors")
    pybullet()  # fail here, before anything is made, and not in every worker
    about, jobs = settings(split, without, encoder_file), jobs_in(split, count)
    _check(folder, about)
    with file_lock(folder):
        _claim(folder, about)
        left = [job for job in jobs if not path_of(folder, *job).exists()]
        run = Parallel(n_jobs=workers, return_as="generator_unordered", batch_size=1)
        for _ in progress(
            run(delayed(_record_to)(folder, encoder_file, *job, without) for job in left)
        ):
            pass
        every = files.join([files.read_clips(path_of(folder, *job)) for job in jobs])
        files.write_clips(folder / files.CLIPS, every)
    return folder


def _check(folder: Path, about: dict) -> None:
    """Refuse a folder that holds anything but clips with these settings."""
    said = folder / "recording.json"
    if said.is_file():
        try:
            found = json.loads(said.read_text(encoding="utf-8"))
        except ValueError:
            found = None
        if found != about:
            raise RecordingError(
                f"{folder} was recorded with other settings, or is no folder of corrected clips; "
                "delete it or record into another folder"
            )
    elif folder.exists() and not folder.is_dir():
        raise RecordingError(f"{folder} is a file; name a new or an empty folder to record into")
    elif folder.exists() and any(path.suffix != PART for path in folder.iterdir()):
        raise RecordingError(
            f"{folder} is not empty and holds no corrected clips; name a new or an empty folder"
        )


def _claim(folder: Path, about: dict) -> None:
    """Mark the folder as a recording, and delete the unfinished files of a run that was killed."""
    if not (folder / "recording.json").exists():
        with atomic_write(folder / "recording.json") as temporary:
            temporary.write_text(json.dumps(about) + "\n", encoding="utf-8")
    for left in (*folder.glob(f"*{PART}"), *folder.glob(f"clips/*{PART}")):
        left.unlink()


@cache
def _encoder(path):
    torch.set_num_threads(1)
    return vision.load_autoencoder(path)


def _record_to(folder: Path, encoder_file, sample: int, round_: int, without) -> None:
    made = record_clip(_encoder(encoder_file), sample, round_, without)
    files.write_clips(path_of(folder, sample, round_), made)


def add_options(parser: ArgumentParser) -> None:
    """Add the options of `corrections`."""
    from ptae_lite.cli import whole_number

    parser.add_argument("--split", default="train", choices=("train", "fit"),
                        help="whose patterns")  # fmt: skip
    parser.add_argument(
        "--out", default="build/corrections", help="folder to record into, or to go on with"
    )
    parser.add_argument("--count", type=whole_number(1), help="clips (default: two a sample)")
    parser.add_argument("--workers", type=whole_number(1), default=2, help="processes side by side")
    parser.add_argument("--without", choices=WITHOUT, help="what a control does without")


def command(given) -> dict:
    """Record; returns what the command prints."""
    from ptae_lite.cli import bar, refuse_data

    refuse_data(given.out, "build/corrections")
    wanted = jobs_in(given.split, given.count)
    left = sum(not path_of(given.out, *job).exists() for job in wanted)
    record(
        given.out, given.split, count=given.count, workers=given.workers, without=given.without,
        progress=lambda runs: bar(runs, total=left, desc="corrections", unit=" clips"),
    )  # fmt: skip
    every = files.load_clips(given.out)
    return {"clips": len(every), "recorded_now": left, "successes": int(every.success.sum())}
