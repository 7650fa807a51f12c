"""The networks: encoders, decoders, and the models made of them."""

from ptae_lite.models.pgae import PGAE, PGAEConfig
from ptae_lite.models.ptae import PTAE, PTAEConfig
from ptae_lite.models.pvae import PVAE, PRAEConfig, PVAEConfig
from ptae_lite.models.registry import MODELS

__all__ = [
    "MODELS",
    "PGAE",
    "PTAE",
    "PVAE",
    "PGAEConfig",
    "PRAEConfig",
    "PTAEConfig",
    "PVAEConfig",
]
