"""How weights follow their gradients: Muon for the hidden matrices, Adam for all else.

Adam scales the step of each weight by its own gradients. Muon treats a matrix as a whole: it makes
the singular values of an update about equal. So a direction that few samples ask for is learned as
fast as one that all samples ask for. Both follow one schedule.
"""

from __future__ import annotations

import math
from collections import defaultdict

import torch
from torch import Tensor, nn

from ptae_lite.recipe import Recipe

ITERATIONS = 5  # Newton-Schulz iterations and coefficients: as published
COEFFICIENTS = (3.4445, -4.7750, 2.0315)
MATCH_ADAM = 0.2  # makes an entry of an update about as large as with Adam at the same rate


class Muon(torch.optim.Optimizer):
    """Momentum that is orthogonalised block by block (Jordan et al. 2024).

    `torch.optim.Muon` makes a matrix orthogonal as a whole, in bfloat16. Here it is cut into blocks
    of at most `rows` rows, and blocks of one shape are computed together, in float32: this takes a
    third of the time for our small matrices, and the gates of a recurrent layer do not mix.

    Args:
        params: matrices, or groups of them with `lr` and `weight_decay` of their own.
        momentum: the momentum coefficient (with Nesterov's correction).
        weight_decay: before an update a matrix shrinks by the factor 1 - lr * weight_decay, as
            with AdamW.
        rows: the largest number of rows of a block.
    """

    def __init__(self, params, lr: float = 1e-3, momentum: float = 0.95,
                 weight_decay: float = 0.0, rows: int = 64):  # fmt: skip
        settings = {"lr": lr, "momentum": momentum, "weight_decay": weight_decay, "rows": rows}
        super().__init__(params, settings)

    @torch.no_grad()
    def step(self, closure=None) -> None:
        """Change each matrix by lr * 0.2 * sqrt(longer side of a block) * its orthogonal update."""
        stacks = defaultdict(list)  # by the shape of a block: matrix, rate, update in blocks
        for group in self.param_groups:
            for matrix in group["params"]:
                if group["weight_decay"]:
                    matrix.mul_(1 - group["lr"] * group["weight_decay"])
                state = self.state[matrix]
                if not state:
                    state["momentum"] = torch.zeros_like(matrix)
                momentum, keep = state["momentum"], group["momentum"]
                momentum.lerp_(matrix.grad, 1 - keep)
                blocks = blocks_of(matrix.grad.lerp(momentum, keep), group["rows"])
                stacks[blocks.shape[1:]].append((matrix, group["lr"], blocks))
        for shape, parts in stacks.items():
            updates = orthogonal(torch.cat([blocks for *_, blocks in parts]))
            updates = updates.split([len(blocks) for *_, blocks in parts])
            for (matrix, rate, _), update in zip(parts, updates, strict=True):
                size = rate * MATCH_ADAM * math.sqrt(max(shape))
                matrix.sub_(update.reshape(matrix.shape), alpha=size)


def blocks_of(matrix: Tensor, rows: int) -> Tensor:
    """A matrix (R, C) as blocks (N, R / N, C) of at most `rows` rows, as few as there can be."""
    count = next(
        n for n in range(1, len(matrix) + 1) if not len(matrix) % n and len(matrix) // n <= rows
    )
    return matrix.reshape(count, -1, matrix.shape[1])


def orthogonal(blocks: Tensor) -> Tensor:
    """Blocks (N, R, C) whose singular values are brought near 1, between about 0.7 and 1.2.

    Each iteration multiplies x by p = a + b g + c g g, where g = x x^T. So the iterations need only
    the small square matrices: g becomes p g p, and the product q of all p is applied at the end.
    """
    a, b, c = COEFFICIENTS
    tall = blocks.shape[1] > blocks.shape[2]
    x = blocks.mT if tall else blocks
    x = x / (x.norm(dim=(1, 2), keepdim=True) + 1e-7)
    gram = torch.bmm(x, x.mT)
    for i in range(ITERATIONS):
        p = torch.baddbmm(gram, gram, gram, beta=b, alpha=c)
        p.diagonal(dim1=1, dim2=2).add_(a)
        q = torch.bmm(p, q) if i else p
        if i < ITERATIONS - 1:
            gram = torch.bmm(torch.bmm(p, gram), p)
    x = torch.bmm(q, x)
    return x.mT if tall else x


class Optimiser:
    """Muon and Adam side by side, with the schedule of a training's recipe.

    Muon moves the hidden matrices, if the recipe has a rate for it; Adam moves embeddings, outputs,
    biases and peepholes. The action decoder has rates of its own.

    Args:
        steps: updates of the whole training.
    """

    def __init__(self, network: nn.Module, recipe: Recipe, steps: int):
        self.parameters = list(network.parameters())
        own = {id(p) for p in network.action.parameters()}
        faster = {True: recipe.action_lr_scale, False: 1.0}
        hidden = {id(p) for p in self.parameters if recipe.muon_lr and is_hidden(p)}

        def groups(rate: float, chosen) -> list[dict]:
            parts = {place: [p for p in chosen if (id(p) in own) == place] for place in faster}
            return [{"params": p, "lr": rate * faster[k]} for k, p in parts.items() if p]

        rest = groups(recipe.learning_rate, [p for p in self.parameters if id(p) not in hidden])
        self.parts = [torch.optim.Adam(rest, fused=True)]
        if hidden:
            matrices = [p for p in self.parameters if id(p) in hidden]
            parts = groups(recipe.muon_lr, matrices)
            for part in parts:  # a group has matrices of the action decoder only, or none of them
                part["weight_decay"] = 0.0 if id(part["params"][0]) in own else recipe.muon_decay
            self.parts.append(Muon(parts))
        self.schedules = [schedule(part, recipe, steps) for part in self.parts]
        self.clip = recipe.clip

    def step(self, loss: Tensor) -> None:
        """Move the weights against the gradient of `loss`, and the schedule by one update."""
        for part in self.parts:
            part.zero_grad()
        loss.backward()
        nn.utils.clip_grad_norm_(self.parameters, self.clip)
        for part, rates in zip(self.parts, self.schedules, strict=True):
            part.step()
            rates.step()

    def state_dict(self) -> dict:
        """What a training that goes on needs, beside the weights."""
        return {"parts": [p.state_dict() for p in self.parts],
                "schedules": [s.state_dict() for s in self.schedules]}  # fmt: skip

    def load_state_dict(self, state: dict) -> None:
        """Go back to what `state_dict` returned."""
        for kept, there in (("parts", self.parts), ("schedules", self.schedules)):
            for one, found in zip(there, state[kept], strict=True):
                one.load_state_dict(found)


def is_hidden(weights: Tensor) -> bool:
    """Whether a tensor is a matrix with at least 32 rows and columns.

    Maps of words (23 to 28) and of joints (5) are smaller: Muon is not for embeddings and outputs.
    """
    return weights.ndim == 2 and min(weights.shape) >= 32


def schedule(optimiser, recipe: Recipe, steps: int):
    """The schedule of the learning rates: one cycle if `recipe.warmup` is 0. Else the rates rise
    linearly in this share of the updates, then fall linearly to zero.
    """
    if not recipe.warmup:
        peaks = [group["lr"] for group in optimiser.param_groups]
        return torch.optim.lr_scheduler.OneCycleLR(optimiser, peaks, total_steps=steps)

    def share(step: int) -> float:
        done = (step + 1) / steps
        return done / recipe.warmup if done < recipe.warmup else (1 - done) / (1 - recipe.warmup)

    return torch.optim.lr_scheduler.LambdaLR(optimiser, share)
