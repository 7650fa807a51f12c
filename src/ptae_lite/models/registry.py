"""The list of models. To add one, write a file beside this one and a line in `MODELS`."""

from __future__ import annotations

from typing import NamedTuple

from torch import nn

from ptae_lite.models.pgae import PGAE, PGAEConfig
from ptae_lite.models.ptae import PTAE, PTAEConfig
from ptae_lite.models.pvae import PVAE, PRAEConfig, PVAEConfig
from ptae_lite.models.watching import Watcher, WatcherConfig
from ptae_lite.recipe import Recipe


class ModelType(NamedTuple):
    """One row of the registry.

    Args:
        network: the model's class. It has the interface `common.Model` and is made from its
            configuration.
        config: the class of its configuration: sizes and choices, the paper's by default.
        recipe: how it is trained if no other recipe is given.
    """

    network: type[nn.Module]
    config: type
    recipe: Recipe


# Numbers of a recipe that differ from PTAE's are ours, chosen on held-out patterns.
MODELS = {
    "ptae": ModelType(PTAE, PTAEConfig, Recipe()),
    # published 6,000 epochs of 108 batches of 6, at 1e-5
    "pgae": ModelType(PGAE, PGAEConfig, Recipe(epochs=60)),
    # published 15,000 or 40,000 batches of 100, at 1e-4
    "pvae": ModelType(PVAE, PVAEConfig, Recipe(epochs=60, muon_decay=0.0)),
    "prae": ModelType(PVAE, PRAEConfig, Recipe(epochs=60, muon_decay=0.0)),
}

# The recipes with Adam alone, as changes to those of the list: those before Muon. Chapters 05 and
# 06 have trainings of them.
ADAM: dict[str, dict] = {"ptae": {"muon_lr": 0.0, "muon_decay": 0.0, "warmup": 0.0}}
ADAM["pgae"] = ADAM["pvae"] = ADAM["ptae"] | {"learning_rate": 3e-3, "action_lr_scale": 1.0}

# What a file of weights can hold: a model of the list, or a policy that was built on one.
NETWORKS: dict[str, tuple] = {name: (kind.network, kind.config) for name, kind in MODELS.items()}
NETWORKS["watcher"] = (Watcher, WatcherConfig)
