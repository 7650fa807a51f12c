"""Binary data as classic scripts, which a page in a folder can load where it may fetch nothing.

Data is deflated and then written in letters of 15 bits each, in UTF-16: a fifteenth more than the
bytes, where base64 takes a third more. A file is split into pieces, so that a bar can show how far
a page has come. Numbers of several bytes pack better in planes: all first bytes, then all second.
"""

from __future__ import annotations

import json
import zlib
from collections.abc import Mapping
from pathlib import Path

import numpy as np

FIRST = 0x3400  # letters from here to 0xB3FF: no quote, no line end, no half of a pair
BITS = 15
PIECE = 400_000  # letters
PLANES = (1, 2, 4)


def letters(data: bytes) -> str:
    """Bytes as text, 15 bits a letter. The last letter is filled with zeros."""
    bits = np.unpackbits(np.frombuffer(data, np.uint8))
    bits = np.concatenate([bits, np.zeros(-len(bits) % BITS, np.uint8)]).reshape(-1, BITS)
    codes = bits @ (1 << np.arange(BITS - 1, -1, -1, dtype=np.int32)) + FIRST
    return codes.astype("<u2").tobytes().decode("utf-16-le")


def in_planes(data: bytes, count: int) -> bytes:
    """The bytes in an order: every `count`-th from the first on, then from the second on, ..."""
    return b"".join(data[plane::count] for plane in range(count))


def joined(parts: Mapping[str, bytes]) -> tuple[bytes, dict[str, list[int]]]:
    """Parts one behind the other, and of each where it begins, its length, its number of planes."""
    made, places = bytearray(), {}
    for name, part in parts.items():
        planes = min(PLANES, key=lambda count: len(zlib.compress(in_planes(part, count), 1)))
        places[name] = [len(made), len(part), planes]
        made += in_planes(part, planes)
    return bytes(made), places


def write(folder, name: str, parts: Mapping[str, bytes], about: Mapping | None = None) -> dict:
    """Write `NAME.0.js`, `NAME.1.js`, ... into a folder; older pieces of that name go.

    Args:
        about: further entries that the page is told, as JSON.

    Returns:
        what a page must know before it loads them: the number of pieces and of bytes.
    """
    entries = json.dumps(about or {}).encode()
    raw, places = joined(parts | {"about": entries})
    packed = zlib.compress(raw, 9)
    text = letters(packed)
    pieces = [text[i : i + PIECE] for i in range(0, len(text), PIECE)]
    opening = json.dumps({"bytes": len(packed), "parts": places})
    for old in Path(folder).glob(f"{name}.*.js"):
        old.unlink()
    size = 0
    for i, piece in enumerate(pieces):
        script = (
            f'PtaeLive.take({json.dumps(name)}, {i}, "{piece}"{"" if i else ", " + opening});\n'
        )
        path = Path(folder, f"{name}.{i}.js")
        path.write_bytes(b"\xff\xfe" + script.encode("utf-16-le"))
        size += path.stat().st_size
    return {"pieces": len(pieces), "bytes": size}
