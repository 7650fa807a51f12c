"""The authors' published data: read from disk, and every file checked.

A folder holds index files and `target/STREAM_PART/RECORDING/targetNNNNNN.txt`. This is a text
matrix for each stream (`behavior`, `vision`, `language`), part (`train`, `test`), recording and
pattern NNNNNN. The layout is that of the PTAE paper's repository. The files have no licence, so
this project keeps none of them.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import NoReturn

import numpy as np
from jaxtyping import Float, Int

from ptae_lite.errors import RecordingError
from ptae_lite.language import VOCABULARY, Pattern, decode, encode, patterns, sentence

# The authors recorded all patterns six times; a folder has the date. They are variations 0 to 5.
RECORDINGS = ("201207", "201223", "210107", "210115", "210129", "210203")
WIDTH = {"behavior": 5, "vision": 30, "language": len(VOCABULARY)}  # numbers a line
SENTENCE_ROWS = 5  # BOS, action, colour, speed, EOS


@dataclass(frozen=True)
class Published:
    """The clips of a folder, one after another in the order of the patterns: R frames of S samples.

    Attributes:
        joints: 0 to 1; the authors scaled each joint over the whole data set.
        features: as published: 10 numbers each of the red, the green and the blue CAE.
        frames: clip lengths.
        pattern: pattern indices.
        variation: 0 to 5.
    """

    joints: Float[np.ndarray, "R 5"]
    features: Float[np.ndarray, "R 30"]
    frames: Int[np.ndarray, " S"]
    pattern: Int[np.ndarray, " S"]
    variation: Int[np.ndarray, " S"]


def is_authors(folder) -> bool:
    """Whether a folder has the authors' layout: whether it holds `target/`."""
    return (Path(folder) / "target").is_dir()


def parts(folder) -> tuple[str, ...]:
    """The parts in the folder: `train` and `test`, or `train` alone."""
    target = Path(folder) / "target"
    complete = any((target / f"{stream}_test").exists() for stream in WIDTH)
    return ("train", "test") if complete else ("train",)


def read(folder) -> Published:
    """Read and check all files of a folder.

    A complete folder has 108 training and 36 test patterns, six times each. Joints must be 0 to 1,
    and features finite. Joints and features must have as many frames as the speed of the pattern
    asks for (100 or 50). The language file must hold the eight sentences of the pattern, in order,
    one-hot. The index files must agree with our table of patterns. `vocabulary.txt` may be missing,
    because the language files are checked against our words.

    Raises:
        RecordingError: a file is missing or wrong. The message names the file and, if there is one,
            the line.
    """
    folder = Path(folder)
    _check_index_files(folder)
    target, here = folder / "target", parts(folder)
    for part in here:
        _check_names(target, part)
    chosen = [(p, v) for p in patterns() if p.split in here for v in range(len(RECORDINGS))]
    joints, features = [], []
    for p, variation in chosen:
        path = {
            stream: target / f"{stream}_{p.split}" / RECORDINGS[variation] / _name(p)
            for stream in WIDTH
        }
        joints.append(_joints(path["behavior"], p))
        features.append(_features(path["vision"], p))
        _check_language(path["language"], p)
    return Published(
        joints=np.concatenate(joints),
        features=np.concatenate(features),
        frames=np.array([p.frames for p, _ in chosen]),
        pattern=np.array([p.index for p, _ in chosen]),
        variation=np.array([variation for _, variation in chosen]),
    )


def _name(p: Pattern) -> str:
    return f"target{p.index:06}.txt"


def _refuse(path: Path, line: int, wrong: str) -> NoReturn:
    raise RecordingError(f"{path}, line {line}: {wrong}")


def _lines(path: Path) -> list[str]:
    try:
        return path.read_text(encoding="ascii").rstrip("\n").split("\n")
    except FileNotFoundError:
        raise RecordingError(f"{path} is missing; the published data has it") from None
    except (OSError, UnicodeDecodeError) as error:
        raise RecordingError(f"{path} is no readable text file ({error})") from None


def _check_names(target: Path, part: str) -> None:
    """Check that each recording has one file for each pattern of the part, and no other files."""
    wanted = {_name(p) for p in patterns() if p.split == part}
    for stream in WIDTH:
        for recording in RECORDINGS:
            folder = target / f"{stream}_{part}" / recording
            found = {path.name for path in folder.glob("target*.txt")}
            if wanted - found:
                name = min(wanted - found)
                raise RecordingError(
                    f"{folder / name} is missing; each recording has one file for each of the "
                    f"{len(wanted)} {part} patterns"
                )
            if found - wanted:
                name = min(found - wanted)
                raise RecordingError(f"{folder / name} belongs to no pattern of the {part} part")


def _check_index_files(folder: Path) -> None:
    """Check `actions.txt`, `arrangements.txt` and `descriptions.txt` against our patterns."""
    speeds, all_patterns = {"slowly": "SLOW", "fast": "FAST"}, patterns()
    wanted = {
        "actions.txt": [
            f"{p.action.upper()}-{p.side[0].upper()}-{speeds[p.speed]} {p.split}"
            for p in all_patterns
        ],
        "arrangements.txt": [f"{p.left}+{p.right}" for p in all_patterns],
        "descriptions.txt": [sentence(p.meaning, k) for k in range(8) for p in all_patterns],
    }
    for name, lines in wanted.items():
        _check_lines(folder / name, _lines(folder / name), lines)
    vocabulary = folder / "vocabulary.txt"
    if vocabulary.exists():  # 23 words; in some of their repositories the signals follow
        words = _lines(vocabulary)[: len(VOCABULARY)]
        _check_lines(vocabulary, words, ["<BOS/EOS>", *VOCABULARY[1:]])


def _check_lines(path: Path, found: list[str], wanted: list[str]) -> None:
    for number, (line, want) in enumerate(zip(found, wanted, strict=False), 1):
        if " ".join(line.split()) != want:  # actions.txt pads its columns with spaces
            _refuse(path, number, f"says {line!r}, not {want!r}")
    if len(found) != len(wanted):
        line = min(len(found), len(wanted)) + 1
        _refuse(path, line, f"the file has {len(found)} lines, not {len(wanted)}")


def _matrix(path: Path, height: int, width: int, why: str) -> Float[np.ndarray, "height width"]:
    rows = [line.split() for line in _lines(path)]
    for number, row in enumerate(rows, 1):
        if len(row) != width:
            _refuse(path, number, f"has {len(row)} numbers, not {width}")
    if len(rows) != height:
        line = min(len(rows), height) + 1
        _refuse(path, line, f"the file has {len(rows)} lines, but {why} has {height}")
    try:
        return _numbers(rows)
    except ValueError:
        pass
    for number, row in enumerate(rows, 1):  # find the line, for the message
        try:
            _numbers(row)
        except ValueError as error:
            _refuse(path, number, str(error))


def _numbers(texts: list) -> np.ndarray:
    with np.errstate(over="ignore"):  # infinity is refused by the caller
        return np.array(texts, dtype=np.float32)


def _frames(path: Path, p: Pattern, width: int) -> Float[np.ndarray, "T width"]:
    """A matrix with one line a frame, as many as the pattern has."""
    return _matrix(path, p.frames, width, f"a clip of pattern {p.index} ({p.speed})")


def _joints(path: Path, p: Pattern) -> Float[np.ndarray, "T 5"]:
    joints = _frames(path, p, WIDTH["behavior"])
    for frame, joint in np.argwhere(~((joints >= 0) & (joints <= 1)))[:1].tolist():
        _refuse(path, frame + 1, f"joint {joint + 1} is {joints[frame, joint]:g}, not in 0 to 1")
    return joints


def _features(path: Path, p: Pattern) -> Float[np.ndarray, "T 30"]:
    features = _frames(path, p, WIDTH["vision"])
    for frame, k in np.argwhere(~np.isfinite(features))[:1].tolist():
        _refuse(path, frame + 1, f"feature {k + 1} is {features[frame, k]:g}, not finite")
    return features


def _check_language(path: Path, p: Pattern) -> None:
    rows = _matrix(path, 8 * SENTENCE_ROWS, WIDTH["language"], "a language file")
    one_hot = ((rows == 0) | (rows == 1)).all(1) & (rows.sum(1) == 1)
    for row in np.flatnonzero(~one_hot)[:1].tolist():
        _refuse(path, row + 1, "is not one-hot: it needs a single 1 among zeros")
    said = rows.argmax(1).reshape(8, SENTENCE_ROWS)
    wanted = np.array([encode(sentence(p.meaning, k)) for k in range(8)])
    for k, place in np.argwhere(said != wanted)[:1].tolist():
        _refuse(
            path,
            SENTENCE_ROWS * k + place + 1,
            f"sentence {k} of pattern {p.index} reads {decode(said[k])!r}, "
            f"not {sentence(p.meaning, k)!r}",
        )
