"""Where arithmetic is done: the CPU, or a GPU if there is one and it is asked for.

Scores may differ in their last digits, no more.
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
    """Raise `ConfigError` if a device cannot be used here."""
    try:
        torch.zeros(1, device=device)
    except (RuntimeError, AssertionError, NotImplementedError):
        raise ConfigError(
            f"device {device!r} cannot be used here, or PyTorch was built without it; "
            "train without --device to use the CPU"
        ) from None


@contextmanager
def seeded(seed: int, device: str) -> Iterator[None]:
    """Inside, PyTorch draws from `seed`; afterwards its generators go on as if nothing had been."""
    with torch.random.fork_rng([] if torch.device(device).type == "cpu" else [device]):
        torch.manual_seed(seed)
        yield


@contextmanager
def whole_float32() -> Iterator[None]:
    """Inside, cuDNN computes with all bits of float32, as the CPU does; by default it does not."""
    before = torch.backends.cudnn.allow_tf32
    torch.backends.cudnn.allow_tf32 = False
    try:
        yield
    finally:
        torch.backends.cudnn.allow_tf32 = before


def choose(wanted: str) -> str:
    """`auto` is a GPU where there is one."""
    return ("cuda" if torch.cuda.is_available() else "cpu") if wanted == "auto" else wanted


def clock(device: str) -> float:
    """Seconds of computing up to now: of this process's core, or of the wall where a GPU works."""
    if torch.device(device).type != "cuda":
        return time.process_time()
    torch.cuda.synchronize()
    return time.perf_counter()


WARM_UPS = 3  # calls that run as they are, in which libraries choose how they compute


class Replayed:
    """A function of one tensor, of the same shape at each call; on a GPU, recorded and replayed.

    A small network asks for hundreds of short computations a step, and to launch them one by one
    takes longer than to do them. What is returned is overwritten by the next call.
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
        """Call it on another stream, as a recording that follows needs it."""
        stream, here = torch.cuda.Stream(), torch.cuda.current_stream()
        stream.wait_stream(here)
        with torch.cuda.stream(stream), warnings.catch_warnings():
            warnings.simplefilter("ignore", UserWarning)  # that it is not recorded
            result = self.function(x)
        here.wait_stream(stream)
        return result
