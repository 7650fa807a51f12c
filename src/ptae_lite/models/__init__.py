"""The networks: encoders, decoders, and the models made of them."""

from ptae_lite.models.pgae import PGAE, PGAEConfig
from ptae_lite.models.ptae import PTAE, PTAEConfig
from ptae_lite.models.pvae import PVAE, PRAEConfig, PVAEConfig
from ptae_lite.models.registry import ADAM, MODELS

__all__ = [
    "ADAM",
    "MODELS",
    "PGAE",
    "PTAE",
    "PVAE",
    "PGAEConfig",
    "PRAEConfig",
    "PTAEConfig",
    "PVAEConfig",
]
