"""What was computed stays as it was: digests of each stored array, tensor and column.

`stored_content.csv` was written from `data/` as it stood at commit a72356f, when columns, keys and
labels had other names (`renamed`). A file that is made anew leaves that list with its new content.
"""

import hashlib
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from safetensors import safe_open

from ptae_lite import artefacts

KNOWN = pd.read_csv(Path(__file__).with_name("stored_content.csv"))


def contents(path: Path) -> dict[str, bytes]:
    """The bytes of each part of a stored file, whatever wraps them."""
    if path.suffix == ".csv":
        table = pd.read_csv(path, dtype=str, keep_default_na=False)
        return {name: "\n".join(table[name]).encode() for name in table}
    if path.suffix == ".npz":
        with np.load(path, allow_pickle=False) as file:
            return {name: file[name].tobytes() for name in file.files}
    if path.suffix == ".safetensors":
        with safe_open(path, framework="np") as file:
            return {name: file.get_tensor(name).tobytes() for name in file.keys()}  # noqa: SIM118
    return {"": path.read_bytes()}


@pytest.mark.parametrize("name", KNOWN["file"].unique())
def test_what_was_computed_is_what_is_stored(name):
    listed = KNOWN[KNOWN["file"] == name].fillna("").set_index("part")["sha256"].to_dict()
    found = contents(artefacts.stored(name))
    assert {part: hashlib.sha256(content).hexdigest() for part, content in found.items()} == listed


def test_every_stored_file_is_listed_or_made_since():
    assert set(KNOWN["file"]) <= set(artefacts.manifest())
