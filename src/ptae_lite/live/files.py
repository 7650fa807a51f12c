"""Everything that live parts load, written into the site: `python -m ptae_lite.live.files FOLDER`.

Models come from `data/weights/`, runtimes from the scripts by others. Nothing is written by hand.
The same inputs give the same bytes.
"""

from __future__ import annotations

import argparse
import json
import shutil
import sys
import time
from importlib import metadata
from pathlib import Path

import torch

from ptae_lite import artefacts, vision
from ptae_lite.data.samples import Samples, load_samples
from ptae_lite.live import clips, export, models, networks, packing, scripts, world
from ptae_lite.models import checkpoint

JS = Path(__file__).parent / "js"
ORT = "onnxruntime-web/dist"
ENCODER = "weights/cae.safetensors"
APACHE = "safetensors"  # a Python package that carries the text of its licence, Apache-2.0
LICENCES = ("onnxruntime-web", "@mujoco/mujoco")


def model(folder, name: str, path) -> dict:
    """Write a PTAE or a policy that watches; returns what `packing.write` does."""
    trained = checkpoint.load(path)
    unused = models.unused(name)
    parts = {key: export.graph(part) for key, part in networks.parts_of(trained.model).items()
             if key not in unused}  # fmt: skip
    scaling = {key: value.tolist() for key, value in vars(trained.scaling).items()}
    watches = trained.model.kind == "watcher"
    looks_once = not watches and trained.model.config.freeze_video
    about = {"scaling": scaling, "freeze_video": looks_once, "watches": watches}
    return packing.write(folder, name, parts, about)


def autoencoder(folder, path, short: bool = True) -> dict:
    """Write the image encoder with its decoder."""
    found = networks.parts_of_autoencoder(vision.load_autoencoder(path))
    parts = {key: export.graph(part, short) for key, part in found.items()}
    return packing.write(folder, "autoencoder", parts)


def book(folder, samples: Samples) -> dict:
    """Write clips, words, the table of tasks and the mean motions."""
    parts, about = clips.parts(samples, clips.chosen(samples))
    scaling = checkpoint.load(artefacts.stored(models.FIRST["ptae"])).scaling
    more, of_motions = clips.of_motions(samples, scaling)
    return packing.write(folder, "book", parts | more, about | of_motions | clips.of_language())


def runtime(folder) -> dict:
    """Write onnxruntime-web: a script as it is, and its WebAssembly, packed."""
    source = scripts.folder() / ORT
    script = (source / "ort.wasm.min.js").read_text("utf-8")
    script = "\n".join(line for line in script.splitlines() if "sourceMappingURL" not in line)
    (Path(folder) / "ort.js").write_text(script + "\n", "utf-8", newline="\n")
    name = "ort-wasm-simd-threaded"
    parts = {kind: (source / f"{name}.{kind}").read_bytes() for kind in ("wasm", "mjs")}
    return packing.write(folder, "ort", parts)


def licences(folder) -> None:
    """Write the licences of the scripts by others beside them."""
    text = []
    for name in LICENCES:
        package = scripts.folder() / name
        about = json.loads((package / "package.json").read_text("utf-8"))
        text.append(f"{name} {about['version']}, licence {about['license']}\n")
        found = [path for path in sorted(package.iterdir()) if path.stem.upper() == "LICENSE"]
        text += [path.read_text("utf-8") for path in found] or [of_apache(about["license"])]
    (Path(folder) / "LICENSES.txt").write_text("\n\n".join(text), "utf-8", newline="\n")


def of_apache(licence: str) -> str:
    """The text of Apache-2.0; nothing for another licence."""
    files = metadata.files(APACHE) if licence == "Apache-2.0" else []
    return next((file.read_text("utf-8") for file in files if file.name == "LICENSE"), "")


def write(folder) -> dict:
    """Write all files; returns the pieces and bytes of each pack.

    Raises:
        ArtefactError: stored weights are missing or damaged.
        OSError: a script by others is missing.
    """
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    torch.set_num_threads(1)
    samples = load_samples("recording")
    packs = {"ort": runtime(folder), "book": book(folder, samples)}
    packs |= {"mujoco": world.engine(folder), "scene": world.stage(folder, samples)}
    for name, path in models.shipped().items():
        packs[name] = model(folder, name, artefacts.stored(path))
    packs["autoencoder"] = autoencoder(folder, artefacts.stored(ENCODER))
    for path in sorted(JS.glob("*.js")):
        shutil.copyfile(path, folder / path.name)
    licences(folder)
    index = {"packs": packs, **models.choices()}
    index = "".join(f"PtaeLive.{name} = {json.dumps(value)};\n" for name, value in index.items())
    (folder / "packs.js").write_text(index, "utf-8", newline="\n")
    return packs


def main(arguments=None) -> int:
    """Write the files; returns the exit code."""
    parser = argparse.ArgumentParser(description=__doc__.split(":")[0] + ".")
    parser.add_argument("folder", type=Path)
    folder = parser.parse_args(arguments).folder
    begun = time.perf_counter()
    for name, pack in write(folder).items():
        print(f"{name:12} {pack['bytes'] / 1e6:5.2f} MB in {pack['pieces']} pieces")
    print(f"{time.perf_counter() - begun:.1f} s")
    return 0


if __name__ == "__main__":
    sys.exit(main())
