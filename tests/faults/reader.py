"""A reader's run in one process, watched: `python reader.py REPORT`.

Everything that is stored is loaded, a model is asked, a scene and a figure are drawn, without a
simulator. The interpreter's audit hook notes what a stored file could do harm with: files that are
written, sockets, processes, unpickled objects, code that is run and is no module's.
"""

from __future__ import annotations

import json
import os
import sys

import matplotlib

matplotlib.use("Agg")
sys.modules["pybullet"] = None  # as where there is no wheel

# What only has to be imported once is imported before the watch begins: modules are code.
import ptae_lite.__main__ as cli  # noqa: E402
from ptae_lite import artefacts, evaluation, vision  # noqa: E402, F401
from ptae_lite.data import frames  # noqa: E402
from ptae_lite.data.samples import load_samples  # noqa: E402
from ptae_lite.experiments import conflict_examples, episodes, family  # noqa: E402, F401
from ptae_lite.models import checkpoint  # noqa: E402
from ptae_lite.paper import reported  # noqa: E402, F401
from ptae_lite.plots import closed_loop as closed_loop_plots  # noqa: E402
from ptae_lite.widgets import showcase  # noqa: E402, F401

WRITING = os.O_WRONLY | os.O_RDWR | os.O_CREAT | os.O_TRUNC | os.O_APPEND
SOCKETS = ("socket.connect", "socket.bind", "socket.getaddrinfo", "socket.gethostbyname")
noted: dict[str, list] = {
    "written": [], "sockets": [], "processes": [], "unpickled": [], "executed": []
}  # fmt: skip


def watch(event: str, arguments: tuple) -> None:
    if event == "open":
        path, mode, flags = arguments
        if flags & WRITING and str(path) != os.devnull and isinstance(path, str):
            noted["written"].append(path)
    elif event in ("os.mkdir", "os.rename", "os.remove", "shutil.copyfile"):
        noted["written"].append(str(arguments[0]))
    elif event in SOCKETS:
        noted["sockets"].append(event)
    elif event in ("subprocess.Popen", "os.system", "os.exec", "os.posix_spawn"):
        noted["processes"].append(str(arguments[0]))
    elif event == "pickle.find_class":
        noted["unpickled"].append(".".join(map(str, arguments[:2])))
    elif event == "exec" and arguments[0].co_filename.startswith("<"):  # not a module's file
        caller = sys._getframe(1)
        noted["executed"].append(f"{caller.f_globals['__name__']}.{caller.f_code.co_name}")


def read_everything() -> None:
    for name in artefacts.manifest():
        artefacts.stored(name)
    samples = load_samples()
    for name in ("weights/cae.safetensors", "weights/plain_cae.safetensors"):
        encoder = vision.load_autoencoder(artefacts.stored(name))
        vision.encode_images(encoder, frames.images(frames.stored_keys()[:2]))
    trained = checkpoint.load(artefacts.stored("weights/ptae.safetensors"))
    evaluation.evaluate(trained, samples, "held_out")
    conflict_examples.load()
    episodes.load()
    closed_loop_plots.strips()
    showcase.panel(samples)


if __name__ == "__main__":
    sys.addaudithook(watch)
    read_everything()
    seen = {what: sorted(set(paths)) for what, paths in noted.items()}
    refused = cli.main(["record", "--out", sys.argv[1] + " recording"])
    with open(sys.argv[1], "w", encoding="utf-8") as file:
        watched = sys.argv[1] in noted["written"]  # this very file: the hook does its work
        json.dump(seen | {"record": refused, "watched": watched}, file)
