"""A network as an ONNX graph: what onnxruntime-web loads.

Weights are stored in 16 bits. The graph first turns them into float32 and computes in it.
"""

from __future__ import annotations

import logging
import warnings

import numpy as np
import onnx
import torch
from onnx import TensorProto, helper, numpy_helper
from torch.export import Dim

from ptae_lite.live.networks import Part

LEVELS = 2**13 - 1
SAME = ("Unsqueeze", "Reshape", "Slice", "ReduceMax")  # of truth values they make truth values
OPSET = 21  # the first in which whole numbers of 16 bits are weights


def graph(part: Part, short: bool = True) -> bytes:
    """The ONNX file of a network. The same weights give the same bytes.

    Args:
        short: store matrices in 16 bits a number.
    """
    network = part.network.eval().requires_grad_(False)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of the exporter about itself
        logging.getLogger("torch.onnx").setLevel(logging.ERROR)
        program = torch.onnx.export(
            network, tuple(part.inputs.values()), dynamo=True, verbose=False,
            input_names=list(part.inputs), output_names=list(part.outputs), opset_version=OPSET,
            dynamic_shapes=_lengths(part),
        )  # fmt: skip
    model = program.model_proto
    _forget_origin(model)
    _without_casts(model.graph)
    if short:
        _shorten(model.graph)
    return model.SerializeToString(deterministic=True)


def _lengths(part: Part):
    """Which axes may have another length, in the order of the inputs; None if none may."""
    if not part.any_length:
        return None
    given = {name: {1: Dim("length", min=2, max=tensor.shape[1])} if name in part.any_length else {}
             for name, tensor in part.inputs.items()}  # fmt: skip
    return tuple(given.values())


def _forget_origin(model: onnx.ModelProto) -> None:
    """Drop what the exporter says of our source files: paths and lines of this machine."""
    del model.metadata_props[:], model.graph.metadata_props[:], model.graph.value_info[:]
    for one in (*model.graph.node, *model.graph.initializer, *model.graph.input,
                *model.graph.output):  # fmt: skip
        del one.metadata_props[:]
        one.doc_string = ""
    model.doc_string = model.graph.doc_string = ""


def _without_casts(made: onnx.GraphProto) -> None:
    """Let `Where` make numbers of truth values, and `Greater` make truth of them, not `Cast`.

    The runtime's `Cast` is one function for all pairs of types, half a megabyte of code. When it
    has run a few times, a browser takes seconds and 100 MB to make it fast.
    """
    truth = {one.name: one.name for one in made.input
             if one.type.tensor_type.elem_type == TensorProto.BOOL}  # fmt: skip
    kinds = {}  # of numbers that are 0 or 1

    def constant(name: str, value) -> str:
        made.initializer.append(numpy_helper.from_array(np.array(value), name))
        return name

    for node in made.node:
        first, out = next(iter(node.input), ""), node.output[0]
        to = node.attribute[0].i if node.op_type == "Cast" else None
        if to == TensorProto.BOOL and first in kinds:
            zero = constant(f"{out}.zero", kinds[first].type(0))
            node.CopyFrom(helper.make_node("Greater", [first, zero], [out]))
            truth[out] = out
        elif to is not None and first in truth:
            kinds[out], truth[out] = helper.tensor_dtype_to_np_dtype(to), truth[first]
            both = [constant(f"{out}.{value}", kinds[out].type(value)) for value in (1, 0)]
            node.CopyFrom(helper.make_node("Where", [truth[first], *both], [out]))
        elif node.op_type == "Equal" or node.op_type in SAME and first in truth.keys() - kinds:
            truth[out] = out
        elif node.op_type in SAME and first in kinds:
            kinds[out] = kinds[first]


def _shorten(made: onnx.GraphProto) -> None:
    """Store every matrix as whole numbers of 16 bits, a scale for each row, and let a node turn
    them back. A row's largest weight is 8,191 levels: errors are below float16's, and the two bits
    that are left over pack to nothing.
    """
    nodes, scales = [], []
    for tensor in made.initializer:
        axes = [axis for axis, size in enumerate(tensor.dims) if size > 1]
        if tensor.data_type != TensorProto.FLOAT or len(axes) < 2:
            continue
        name, matrix = tensor.name, numpy_helper.to_array(tensor)
        top = np.abs(matrix).max(axis=tuple(set(range(matrix.ndim)) - {axes[0]}), keepdims=True)
        scale = np.where(top > 0, top, 1).astype(np.float32) / LEVELS
        levels = np.rint(matrix / scale).astype(np.int16)
        tensor.CopyFrom(numpy_helper.from_array(levels, f"{name}.levels"))
        scales.append(numpy_helper.from_array(scale.ravel(), f"{name}.scale"))
        inputs = [f"{name}.levels", f"{name}.scale"]
        nodes.append(helper.make_node("DequantizeLinear", inputs, [name], axis=axes[0]))
    made.initializer.extend(scales)
    rest = list(made.node)
    del made.node[:]
    made.node.extend([*nodes, *rest])
