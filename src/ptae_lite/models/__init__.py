"""The networks: the crossmodal encoder, the decoders, and PTAE made of them."""

from ptae_lite.models.ptae import PTAE, PTAEConfig

__all__ = ["PTAE", "PTAEConfig"]
