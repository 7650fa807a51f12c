"""Encoders in front of the crossmodal transformer: none, an LSTM, or BERT.

The paper's figure of the architecture names these choices (language: none, LSTM, BERT; action:
none, LSTM), and its text reports no significant difference between them. Each encoder turns a
sequence into rows of `size` numbers. The published code fails with an LSTM, so we chose ourselves
how its rows enter the transformer.
"""

from __future__ import annotations

from pathlib import Path

import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor, nn
from torch.nn import functional

from ptae_lite.errors import ConfigError
from ptae_lite.language import EOS, TOKENS, VOCABULARY

LANGUAGE = ("none", "lstm", "bert")
ACTION = ("none", "lstm")


class OneHot(nn.Module):
    """No encoder: a token is one-hot, 28 numbers."""

    size = len(TOKENS)

    def forward(self, tokens: Int[Tensor, "B N"], mask: Bool[Tensor, "B N"]):
        """One-hot rows (B, N, 28)."""
        return functional.one_hot(tokens, self.size).to(torch.get_default_dtype())


class Sequence(nn.Module):
    """An LSTM's hidden state after each row; zero after the end of a sequence."""

    def __init__(self, inputs: int, units: int):
        super().__init__()
        self.size = units
        self.lstm = nn.LSTM(inputs, units, batch_first=True)

    def forward(self, rows: Float[Tensor, "B T I"], lengths: Int[Tensor, " B"]):
        """Hidden states (B, T, units)."""
        # not `pack_padded_sequence`: its backward pass is quadratic in the number of steps
        inside = torch.arange(rows.shape[1], device=rows.device) < lengths[:, None]
        return self.lstm(rows)[0] * inside[..., None]


class WordSequence(nn.Module):
    """An LSTM over one-hot tokens."""

    def __init__(self, units: int):
        super().__init__()
        self.one_hot, self.sequence = OneHot(), Sequence(OneHot.size, units)
        self.size = units

    def forward(self, tokens: Int[Tensor, "B N"], mask: Bool[Tensor, "B N"]):
        """Hidden states (B, N, units)."""
        return self.sequence(self.one_hot(tokens, mask), mask.sum(1))


class BertWords(nn.Module):
    """Words as states of BERT; signals, which BERT does not know, as one-hot.

    BERT is loaded from a local folder. It is not trained and not stored with the model. The row of
    a word is the mean of the states of its pieces. The rows of BOS and EOS are the states of [CLS]
    and [SEP]. The states of each sentence are computed once.

    Raises:
        ConfigError: the package transformers is not installed, or the folder holds no BERT.
    """

    def __init__(self, folder: str):
        super().__init__()
        self._tokenizer, bert = _read_bert(folder)
        self._bert = [bert]  # in a list: its weights must not become parameters of the model
        self._seen: dict[tuple[int, ...], Tensor] = {}
        self.size = len(TOKENS) + bert.config.hidden_size

    def forward(self, tokens: Int[Tensor, "B N"], mask: Bool[Tensor, "B N"]):
        """Rows (B, N, 28 + E), with E the width of BERT's states."""
        rows = torch.zeros(*tokens.shape, self.size, device=tokens.device)
        signals = tokens >= len(VOCABULARY)
        rows[..., : len(TOKENS)] = functional.one_hot(tokens, len(TOKENS)) * signals[..., None]
        for i, (line, there) in enumerate(zip(tokens.tolist(), mask.tolist(), strict=True)):
            words = tuple(t for t, used in zip(line, there, strict=True) if used)[1:]
            rows[i, 1 : 1 + len(words), len(TOKENS) :] = self._states(words).to(rows)
        return rows

    def _states(self, words: tuple[int, ...]) -> Float[Tensor, "N E"]:
        if words not in self._seen:
            with torch.no_grad():  # on the CPU, where BERT stays
                self._seen[words] = self._read(words)
        return self._seen[words]

    def _read(self, words: tuple[int, ...]) -> Float[Tensor, "N E"]:
        text = [VOCABULARY[i] for i in words if i != EOS]
        pieces = self._tokenizer(text, is_split_into_words=True, return_tensors="pt")
        states = self._bert[0](**pieces).last_hidden_state[0]
        of_word = pieces.word_ids()
        rows = [states[:1]] if text else []  # BOS; without a sentence there is EOS alone
        for n in range(len(text)):
            mine = [i for i, word in enumerate(of_word) if word == n]
            rows.append(states[mine].mean(0, keepdim=True))
        return torch.cat([*rows, states[-1:]])


def _read_bert(folder: str):
    try:
        from transformers import AutoModel, AutoTokenizer
    except ImportError:
        raise ConfigError(
            "a BERT language encoder needs the package transformers, which is not installed; "
            "install it with: python -m pip install -e .[bert]"
        ) from None
    if not (Path(folder) / "config.json").is_file():
        raise ConfigError(
            f"{folder or 'no folder'!r} holds no BERT (no config.json); set `bert` to a local "
            "folder with its config, tokenizer and model.safetensors"
        )
    local = {"local_files_only": True, "trust_remote_code": False}
    try:
        bert = AutoModel.from_pretrained(folder, use_safetensors=True, **local)
        tokenizer = AutoTokenizer.from_pretrained(folder, **local)
    except (OSError, ValueError) as error:
        raise ConfigError(f"the BERT in {folder} cannot be read: {error}") from None
    return tokenizer, bert.eval().requires_grad_(False)


def language_encoder(kind: str, units: int, bert: str) -> nn.Module:
    """The encoder of a name in `LANGUAGE`.

    Raises:
        ConfigError: BERT cannot be loaded.
    """
    if kind == "none":
        return OneHot()
    return BertWords(bert) if kind == "bert" else WordSequence(units)


def action_encoder(kind: str, inputs: int, units: int) -> Sequence | None:
    """The encoder of a name in `ACTION`; None for `none`."""
    return Sequence(inputs, units) if kind == "lstm" else None
