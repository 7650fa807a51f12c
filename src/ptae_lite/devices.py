"""Where the computing is done: on the CPU, or on a GPU if one is asked for.

Scores on two devices may differ in their last digits.
"""

from __future__ import annotations

import time
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import torch
from torch import Tensor

from ptae_lite.errors import ConfigError


def check(device: str) -> None:
    """Check that a device can be used.

    Raises:
        ConfigError: it cannot.
    """
    try:
        torch.zeros(1, device=device)
    except (RuntimeError, AssertionError, NotImplementedError):
        raise ConfigError(
            f"device {device!r} cannot be used here, or PyTorch was built without it; "
            "train without --device to use the CPU"
        ) from None


@contextmanager
def seeded(seed: int, device: str) -> Iterator[None]:
    """Inside, PyTorch draws random numbers from `seed`. Afterwards its generators are as before."""
    with torch.random.fork_rng([] if torch.device(device).type == "cpu" else [device]):
        torch.manual_seed(seed)
        yield


@contextmanager
def whole_float32() -> Iterator[None]:
    """Inside, cuDNN computes with all bits of float32, like the CPU, and not with TF32."""
    before = torch.backends.cudnn.allow_tf32
    torch.backends.cudnn.allow_tf32 = False
    try:
        yield
    finally:
        torch.backends.cudnn.allow_tf32 = before


def choose(wanted: str) -> str:
    """The device of a name: `auto` is the GPU if there is one, else the CPU."""
    return ("cuda" if torch.cuda.is_available() else "cpu") if wanted == "auto" else wanted


def clock(device: str) -> float:
    """Seconds of computing so far: processor time on a CPU, wall time on a GPU."""
    if torch.device(device).type != "cuda":
        return time.process_time()
    torch.cuda.synchronize()
    return time.perf_counter()


WARM_UPS = 3  # calls before the recording; libraries choose their algorithms in them


class Replayed:
    """A function of one tensor. On a GPU it is recorded once and then replayed (a CUDA graph).

    A step of a small network has hundreds of short computations, and starting them one by one takes
    longer than computing them. The tensor must have the same shape at each call. The next call
    overwrites the result.
    """

    def __init__(self, function: Callable[[Tensor], Tensor]):
        self.function, self.calls, self.graph = function, 0, None

    def __call__(self, x: Tensor) -> Tensor:
        if not x.is_cuda:
            return self.function(x)
        if self.calls < WARM_UPS:
            self.calls += 1
            return self._aside(x)
        if self.graph is None:
            self.x, self.graph = x.clone(), torch.cuda.CUDAGraph()
            with torch.cuda.graph(self.graph):  # records and computes nothing
                self.result = self.function(self.x)
        self.x.copy_(x)
        self.graph.replay()
        return self.result

    def _aside(self, x: Tensor) -> Tensor:
        """Call it on another stream, as CUDA asks for before a recording."""
        stream, here = torch.cuda.Stream(), torch.cuda.current_stream()
        stream.wait_stream(here)
        with torch.cuda.stream(stream), warnings.catch_warnings():
            warnings.simplefilter("ignore", UserWarning)  # that it is not recorded
            result = self.function(x)
        here.wait_stream(stream)
        return result
