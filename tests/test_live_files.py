"""What live parts load: letters that become the same bytes, clips, and the place on a page."""

import re
import zlib
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import onnx
import pytest
import torch
from letters import bytes_of
from onnx import TensorProto, helper, numpy_helper
from onnx.reference import ReferenceEvaluator

from ptae_lite.data.signals import WIRING
from ptae_lite.errors import PTAEError
from ptae_lite.language import TOKENS, parse, signal_index
from ptae_lite.live import clips, export, live_part, models, networks, packing, scripts
from ptae_lite.models import watching
from ptae_lite.models.watching import Watcher
from ptae_lite.widgets.panels import Panel

JS = Path(scripts.__file__).parent / "js"


@pytest.mark.parametrize("count", [0, 1, 2, 14, 15, 16, 1000])
def test_letters_become_the_same_bytes(count):
    data = np.random.default_rng(count).bytes(count)
    text = packing.letters(data)
    assert bytes_of(text, count) == data and len(text) == -(-8 * count // 15)


def test_no_letter_ends_a_string_or_is_half_a_pair():
    every = packing.letters(bytes(range(256)) * 400)
    assert {ord(one) for one in every} <= set(range(0x3400, 0xB400))


def test_a_pack_is_read_back_from_its_pieces(tmp_path, monkeypatch):
    monkeypatch.setattr(packing, "PIECE", 50)
    rng = np.random.default_rng(0)
    small = rng.integers(-100, 100, 5000, np.int16)  # high bytes are alike
    parts = {"one": b"abc", "two": rng.bytes(999), "numbers": small.tobytes() + b"x"}
    told = packing.write(tmp_path, "pack", parts, {"says": "ü"})
    files = [tmp_path / f"pack.{i}.js" for i in range(told["pieces"])]
    assert told["pieces"] > 5 and told["bytes"] == sum(file.stat().st_size for file in files)
    texts = [file.read_bytes().decode("utf-16") for file in files]  # takes the byte order mark
    assert all(text.startswith(f'PtaeLive.take("pack", {i}, "') for i, text in enumerate(texts))
    told = packing.json.loads(texts[0][texts[0].index("{") : texts[0].rindex(")")])
    letters = "".join(re.search('[0-9], "(.*?)"', text)[1] for text in texts)
    raw = zlib.decompress(bytes_of(letters, told["bytes"]))
    found = {name: woven(raw[at : at + n], planes) for name, (at, n, planes) in
             told["parts"].items()}  # fmt: skip
    assert packing.json.loads(found.pop("about")) == {"says": "ü"} and found == parts
    assert told["parts"]["numbers"][2] == 2

    (tmp_path / "mine.js").touch()
    few = packing.write(tmp_path, "pack", {"one": b"abc"})  # older pieces go, nothing else
    assert len(list(tmp_path.glob("pack.*.js"))) == few["pieces"] < len(files)
    assert (tmp_path / "mine.js").exists()


def woven(data: bytes, planes: int) -> bytes:
    made = bytearray(len(data))
    for plane in range(planes):
        part, data = data[: len(made[plane::planes])], data[len(made[plane::planes]) :]
        made[plane::planes] = part
    return bytes(made)


def test_columns_come_back_within_a_level():
    rows = np.cumsum(np.random.default_rng(0).normal(size=(500, 4)), axis=0)
    rows[:, 3] = 2.5  # a joint that never moves
    steps, (low, step) = clips.quantised(rows)
    levels = np.cumsum(steps.astype(np.int64), axis=1) & clips.LEVELS
    back = low + step * levels.T
    assert np.abs(back - rows).max() <= 0.51 * step.max()
    assert np.ptp(rows[:, 0]) / step[0] == pytest.approx(clips.LEVELS)


def test_the_page_is_told_the_same_language():
    told = clips.of_language()
    assert tuple(told["tokens"]) == TOKENS and set(told["wiring"]) == set(WIRING)
    assert told["wiring"]["describe"]["video"] == WIRING["describe"].video
    words = [told["classes"][kind][-1] for kind in told["classes"]]
    assert [told["first_word"][word] for word in words] == list(parse(" ".join(words)))


def test_a_model_is_offered_when_its_weights_are_stored(monkeypatch):
    monkeypatch.setattr(models.artefacts, "manifest", lambda: {models.MORE["watching"]: {}})
    assert list(models.shipped()) == ["ptae", "policy", "watching"]
    offered = models.choices()
    assert list(offered["policies"]) == ["watching", "policy", "ptae"]
    assert offered["labelled"] == {"ptae": 100}
    named = set(models.POLICIES) | set(models.LABELLED)
    assert named == set(models.FIRST) | set(models.MORE)


# ---------------------------------------------------------------- graphs


def graph_of(nodes, weights, inputs) -> onnx.ModelProto:
    kinds = {np.dtype(bool): TensorProto.BOOL, np.dtype("f4"): TensorProto.FLOAT}
    given = [helper.make_tensor_value_info(name, kinds[array.dtype], array.shape)
             for name, array in inputs.items()]  # fmt: skip
    out = helper.make_tensor_value_info("out", TensorProto.FLOAT, None)
    weights = [numpy_helper.from_array(array, name) for name, array in weights.items()]
    made = helper.make_graph(nodes, "x", given, [out], weights)
    return helper.make_model(made, opset_imports=[helper.make_opsetid("", export.OPSET)])


def test_truth_becomes_numbers_without_a_cast():
    """Truth to whole numbers to numbers, as of words; a largest one back to truth, as of a mask."""
    truth = np.array([[True, False, True], [False, False, False]])
    node, as_number = helper.make_node, {"to": TensorProto.FLOAT}
    made = graph_of([
        node("Cast", ["truth"], ["whole"], to=TensorProto.INT64),
        node("Cast", ["whole"], ["numbers"], **as_number),
        node("ReduceMax", ["whole", "axis"], ["largest"], keepdims=1),
        node("Cast", ["largest"], ["any"], to=TensorProto.BOOL),
        node("Cast", ["any"], ["ends"], **as_number),
        node("Add", ["numbers", "ends"], ["out"]),
    ], {"axis": np.array([1])}, {"truth": truth})  # fmt: skip
    (before,) = ReferenceEvaluator(made).run(None, {"truth": truth})
    export._without_casts(made.graph)
    assert "Cast" not in {one.op_type for one in made.graph.node}
    (after,) = ReferenceEvaluator(made).run(None, {"truth": truth})
    assert after.tolist() == before.tolist() == [[2, 1, 2], [0, 0, 0]]


def test_weights_of_16_bits_come_back_row_by_row():
    rng = np.random.default_rng(0)
    weights = (rng.normal(size=(4, 50)) * [[1], [1e-3], [0], [100]]).astype(np.float32)
    row = np.eye(4, dtype=np.float32)
    product = helper.make_node("MatMul", ["row", "w"], ["out"])
    made = graph_of([product], {"w": weights}, {"row": row})
    export._shorten(made.graph)
    kinds = {one.name: one.data_type for one in made.graph.initializer}
    assert kinds == {"w.levels": TensorProto.INT16, "w.scale": TensorProto.FLOAT}
    (back,) = ReferenceEvaluator(made).run(None, {"row": row})
    level = np.abs(weights).max(1, keepdims=True) / export.LEVELS
    assert (np.abs(back - weights) <= 0.51 * level).all()


# ---------------------------------------------------------------- a policy that watches


@pytest.mark.parametrize("forgets", [False, True])
@torch.no_grad()
def test_its_parts_one_after_another_are_the_policy(forgets):
    torch.manual_seed(0)
    model = Watcher().eval()
    parts = {name: part.network for name, part in networks.parts_of(model).items()}
    frames, tokens = 6, torch.tensor([[signal_index("execute"), 0, 1, 9, 13, 0]])
    keys, hand = torch.randn(1, frames, 35), 0.3 + 0.1 * torch.randn(1, frames, 3)
    code, look = model.code_of_sentence(tokens), keys[:, 0, :30]
    task, *memory = parts["task"](code, look)
    first, wishes = memory, []
    for t in range(frames):
        wish, *memory = parts["follow"](task, keys[:, t, :30], hand[:, t], *memory)
        wishes.append(wish)
        memory = first if forgets else memory
    numbers = model.understand(code, look)
    expected, *_ = model.follow(numbers, model.read(numbers, keys[..., :30]), hand)
    np.testing.assert_array_equal(task, watching.one_of_each(numbers))
    same = (torch.stack(wishes, 1) - expected).abs().max() < 1e-6
    assert same != forgets


# ---------------------------------------------------------------- clips


def test_every_clip_is_there_once(samples):
    chosen = clips.chosen(samples)
    assert samples.pattern[chosen].tolist() == list(range(144))
    _, told = clips.parts(samples, chosen[:3])
    assert [one["frames"] for one in told["clips"]] == samples.frames[chosen[:3]].tolist()


# ---------------------------------------------------------------- the place on a page


@pytest.fixture
def site(monkeypatch):
    monkeypatch.setenv("PTAE_STATIC", "1")
    monkeypatch.setattr(live_part.scripts, "missing", lambda: [])


def figure():
    return plt.subplots(figsize=(1, 1))[0]


def part_of(stored, **more):
    return live_part.LivePart("conflict", stored, "A part", **more)


def test_stored_answers_stand_in_the_place_of_a_part(site):
    panel = Panel(lambda n: f"number {n}", [1, 2], "Numbers")
    html = part_of(panel)._repr_mimebundle_()["text/html"]
    assert 'data-ptae-live="conflict"' in html and "number 1" in html
    assert "<noscript>" in html


def test_a_stored_image_keeps_its_text(site):
    from ptae_lite.plots import style

    html = part_of(style.photo(figure()), alt='A "thing"')._repr_mimebundle_()["text/html"]
    assert "data:image/jpeg;base64," in html and 'alt="A &quot;thing&quot;"' in html
    assert "aria-label" in part_of(style.chart(figure()), alt="x").html()


def test_without_the_scripts_a_line_says_so(site, monkeypatch):
    monkeypatch.setattr(live_part.scripts, "missing", lambda: ["onnxruntime-web"])
    html = part_of(Panel(lambda n: f"{n}", [1, 2], "Numbers")).html()
    assert live_part.WITHOUT in html and "data-ptae-live" not in html and "<pre>1</pre>" in html


def test_a_notebook_shows_what_is_stored(monkeypatch):
    monkeypatch.setenv("PTAE_STATIC", "0")
    bundle, _ = part_of(Panel(lambda n: f"{n}", [1, 2], "Numbers"))._repr_mimebundle_()
    assert "application/vnd.jupyter.widget-view+json" in bundle


def test_every_part_has_its_script_and_says_what_it_needs():
    loader = (JS / "loader.js").read_text("utf-8")
    names = re.findall(r'"(\w+)"', re.search(r"scripts: \[(.*?)\]", loader, re.DOTALL)[1])
    assert all((JS / f"{name}.js").is_file() for name in names)
    scripts_of_parts = "".join((JS / f"{name}.js").read_text("utf-8") for name in names)
    for part in live_part.PARTS:
        assert re.search(rf"^\s+{part}: \[", loader, re.MULTILINE)
        assert f"PtaeLive.parts.{part} =" in scripts_of_parts
    with pytest.raises(PTAEError, match="no live part 'x'; there are vision, transformer, "):
        live_part.LivePart("x", None, "")
