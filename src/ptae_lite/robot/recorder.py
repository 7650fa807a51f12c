"""Records the data set: each sample once, in its own fresh simulation.

A recording is a folder::

    recording.json          the format, and the fingerprint of the scene
    sequences/p012_v3.npz   one sample: images, joints, cube poses, contacts, seed
    samples.npz             all samples without images, written when all sequences are there

Image t, joints t and cubes t belong to the same instant. A sequence is written to a temporary file
and then renamed. So a recording that was stopped holds whole sequences only, and a new start goes
on with the missing ones.
"""

from __future__ import annotations

import hashlib
import json
import zlib
from dataclasses import dataclass
from pathlib import Path
from zipfile import BadZipFile

import numpy as np
from joblib import Parallel, delayed

from ptae_lite import language
from ptae_lite.errors import RecordingError
from ptae_lite.files import PART, atomic_write, file_lock, write_arrays
from ptae_lite.language import ARRANGEMENTS, Pattern, patterns
from ptae_lite.robot import arm, motions, scene, urdf

FORMAT = "ptae-lite recording 1"
IMAGE = (120, 160, 3)


@dataclass(frozen=True)
class Sequence:
    """One recorded sample of T frames.

    Attributes:
        images: (T, 120, 160, 3) uint8.
        joints_rad: (T, 5) float32, as measured.
        cubes: (T, 2, 7) float32, left and right cube: position in metres, quaternion x y z w.
        touched: (T, 2) bool: whether the arm touched the cube on the way to this frame.
        seed: see `motions.sample_seed`.
    """

    images: np.ndarray
    joints_rad: np.ndarray
    cubes: np.ndarray
    touched: np.ndarray
    seed: int


def record_sequence(pattern: Pattern, variation: int) -> Sequence:
    """Simulate one sample and record it. On one machine, the same sample gives the same bytes."""
    seed = motions.sample_seed(pattern.index, variation)
    drawn = motions.draw(seed)
    targets_rad = motions.plan(pattern, drawn)
    arm.check_limits(targets_rad)
    images, joints, cubes, touched = [], [], [], []
    colours = (pattern.left, pattern.right)
    with scene.Scene(colours, drawn.places_m, drawn.yaws_rad) as world:
        for frame, target_rad in enumerate(targets_rad):
            touched.append(world.drive(target_rad) if frame else (False, False))
            images.append(world.image())
            joints.append(world.joints_rad())
            cubes.append(world.cubes())
    return Sequence(
        np.stack(images),
        np.array(joints, dtype=np.float32),
        np.array(cubes, dtype=np.float32),
        np.array(touched),
        seed,
    )


def fingerprint() -> str:
    """A short hash of what a recording depends on: the robot, the scene and the motions."""
    digest = hashlib.sha256(urdf.nico_urdf().encode())
    things = (
        scene.TABLE_SHAPES, scene.COLOUR_RGBA, scene.LIGHT, scene.VERTICAL_VIEW_DEG,
        scene.POSITION_GAIN, scene.SUBSTEPS, arm.HEAD_YAW_RAD, arm.HEAD_PITCH_RAD,
    )  # fmt: skip
    digest.update(repr(things).encode())
    for pattern in (p for p in patterns() if p.arrangement == ARRANGEMENTS[0]):
        targets_rad = motions.plan(pattern, motions.draw(motions.sample_seed(pattern.index, 0)))
        digest.update(np.round(targets_rad, 4).tobytes())
    return digest.hexdigest()[:16]


def sequence_path(folder: str | Path, pattern_index: int, variation: int) -> Path:
    """Where the file of a sample is."""
    return Path(folder) / "sequences" / f"p{pattern_index:03d}_v{variation}.npz"


def record(folder, *, workers: int = 2, only=None, progress=lambda done: done) -> Path:
    """Record all 864 samples into `folder`, or those that are still missing there.

    Args:
        folder: made if it does not exist.
        workers: number of processes.
        only: pattern indices, to record a part. `samples.npz` is then not written.
        progress: wraps the iterator over finished sequences, as `tqdm` does.

    Raises:
        RecordingError: `folder` holds something else, or a recording of another scene.
        FileError: another run records into it, or it cannot be written.
        LanguageError: a pattern does not exist.
        RobotError: PyBullet is not installed.
    """
    folder = Path(folder)
    for index in only or ():
        language.pattern(index)
    _check_free(folder)
    scene.pybullet()  # fail here, before anything is made, and not in every worker
    with file_lock(folder):
        _claim(folder)
        jobs = [
            (index, variation)
            for index, variation in samples_in_order()
            if (only is None or index in only)
            and not sequence_path(folder, index, variation).exists()
        ]
        run = Parallel(n_jobs=workers, return_as="generator_unordered", batch_size=1)
        for _ in progress(run(delayed(_record_to)(folder, *job) for job in jobs)):
            pass
        if only is None:
            gather(folder)
    return folder


def _check_free(folder: Path) -> None:
    """Refuse a folder that holds anything but a recording of this scene."""
    if (folder / "recording.json").exists():
        check_ours(folder)
    elif folder.exists() and not folder.is_dir():
        raise RecordingError(f"{folder} is a file; name a new or an empty folder to record into")
    elif folder.exists() and any(path.suffix != PART for path in folder.iterdir()):
        raise RecordingError(
            f"{folder} is not empty and is not a recording of ours; name a new or an empty folder"
        )


def _claim(folder: Path) -> None:
    """Mark the folder as a recording, and delete the unfinished files of a run that was killed."""
    if not (folder / "recording.json").exists():
        with atomic_write(folder / "recording.json") as temporary:
            about = {"format": FORMAT, "fingerprint": fingerprint()}
            temporary.write_text(json.dumps(about) + "\n", encoding="utf-8")
    (folder / "sequences").mkdir(exist_ok=True)
    for left in (folder / "sequences").glob(f"*{PART}"):
        left.unlink()


def check_ours(folder: str | Path, *, same_scene: bool = True) -> dict:
    """Read `recording.json`.

    Args:
        same_scene: also refuse a recording that was made with another robot, scene or motion.

    Raises:
        RecordingError: the folder is not a recording of ours.
    """
    about = Path(folder) / "recording.json"
    if not about.is_file():
        raise RecordingError(
            f"{folder} is not a recording (it has no recording.json); "
            "make one with: python -m ptae_lite record"
        )
    try:
        found = json.loads(about.read_text(encoding="utf-8"))
    except ValueError:
        found = {}
    if not isinstance(found, dict) or found.get("format") != FORMAT:
        raise RecordingError(f"{about} does not say {FORMAT!r}; this is no recording of ours")
    if same_scene and found.get("fingerprint") != fingerprint():
        raise RecordingError(
            f"{folder} was recorded with another robot, scene or motion than this version's; "
            "delete it or record into another folder"
        )
    return found


def _record_to(folder: Path, index: int, variation: int) -> None:
    made = record_sequence(patterns()[index], variation)
    path = sequence_path(folder, index, variation)
    write_arrays(path, **vars(made))


def load_sequence(folder, pattern_index: int, variation: int) -> Sequence:
    """Read one sample with its images, and check its shapes and its seed.

    Raises:
        RecordingError: the file is missing, is damaged, or belongs to another sample.
        LanguageError: the pattern does not exist.
    """
    frames = language.pattern(pattern_index).frames
    path = sequence_path(folder, pattern_index, variation)
    if not path.is_file():
        raise RecordingError(f"{path} is missing; go on recording: python -m ptae_lite record")
    try:
        with path.open("rb") as stream, np.load(stream, allow_pickle=False) as file:
            arrays = {name: file[name] for name in file.files}
        made = Sequence(**arrays | {"seed": int(arrays["seed"])})
    except (OSError, ValueError, TypeError, EOFError, KeyError, BadZipFile, zlib.error) as error:
        raise RecordingError(f"{path} is damaged ({error}); delete it and record again") from None
    for name in ("images", "joints_rad", "cubes", "touched"):
        length = len(getattr(made, name))
        if length != frames:
            raise RecordingError(
                f"{path}: {name} has {length} frames where pattern {pattern_index} has {frames}; "
                "delete it and record again"
            )
    if made.images.shape[1:] != IMAGE or made.images.dtype != np.uint8:
        raise RecordingError(
            f"{path}: images are {made.images.shape[1:]} of {made.images.dtype}, "
            f"not {IMAGE} of uint8; delete it and record again"
        )
    own = motions.sample_seed(pattern_index, variation)
    if made.seed != own:
        raise RecordingError(
            f"{path} holds sample {made.seed}, not {own}: files were swapped; "
            "delete it and record again"
        )
    return made


def samples_in_order() -> list[tuple[int, int]]:
    """(pattern, variation) of all 864 samples, in the order of every stored array."""
    return [(p.index, v) for p in patterns() for v in range(motions.VARIATIONS)]


def gather(folder) -> Path:
    """Write `samples.npz`: joints, cubes and contacts of all samples, without the images.

    Raises:
        RecordingError: a sequence is missing or damaged.
    """
    folder = Path(folder)
    columns = {name: [] for name in ("joints_rad", "cubes", "touched", "pattern", "variation")}
    columns |= {"seed": [], "frames": []}
    for index, variation in samples_in_order():
        made = load_sequence(folder, index, variation)
        columns["joints_rad"].append(made.joints_rad)
        columns["cubes"].append(made.cubes)
        columns["touched"].append(made.touched)
        columns["pattern"].append([index])
        columns["variation"].append([variation])
        columns["seed"].append([made.seed])
        columns["frames"].append([len(made.joints_rad)])
    path = folder / "samples.npz"
    arrays = {name: np.concatenate(parts) for name, parts in columns.items()}
    write_arrays(path, **arrays)
    return path
