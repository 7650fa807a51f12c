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

LEVELS = 2**15 - 1


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
            input_names=list(part.inputs), output_names=list(part.outputs),
            dynamic_shapes=_lengths(part),
        )  # fmt: skip
    model = program.model_proto
    _forget_origin(model)
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


def _shorten(made: onnx.GraphProto) -> None:
    """Store every matrix as whole numbers of 16 bits, a scale for each row, and let two nodes turn
    them back. A row's largest weight is 32,767 levels, so errors are a tenth of float16's.
    """
    nodes, scales = [], []
    for tensor in made.initializer:
        if tensor.data_type != TensorProto.FLOAT or len(tensor.dims) < 2:
            continue
        name, matrix = tensor.name, numpy_helper.to_array(tensor)
        top = np.abs(matrix).max(axis=tuple(range(1, matrix.ndim)), keepdims=True)
        scale = np.where(top > 0, top, 1).astype(np.float32) / LEVELS
        levels = np.rint(matrix / scale).astype(np.int16)
        tensor.CopyFrom(numpy_helper.from_array(levels, f"{name}.levels"))
        scales.append(numpy_helper.from_array(scale, f"{name}.scale"))
        nodes += [
            helper.make_node("Cast", [f"{name}.levels"], [f"{name}.whole"], to=TensorProto.FLOAT),
            helper.make_node("Mul", [f"{name}.whole", f"{name}.scale"], [name]),
        ]
    made.initializer.extend(scales)
    rest = list(made.node)
    del made.node[:]
    made.node.extend([*nodes, *rest])
