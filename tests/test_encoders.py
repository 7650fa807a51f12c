"""Encoders in front of the crossmodal transformer: none, LSTM, BERT from a local folder."""

import sys
from dataclasses import replace

import pytest
import torch

from ptae_lite.data.signals import build
from ptae_lite.errors import ConfigError
from ptae_lite.language import EOS, SIGNALS, SYNONYMS, TOKENS, encode, signal_index
from ptae_lite.models import PTAE, checkpoint
from ptae_lite.models.common import losses
from ptae_lite.models.encoders import OneHot, Sequence, language_encoder
from ptae_lite.training import Recipe, train


@pytest.fixture
def mixed(source):
    """Ten samples, slow and fast, with all five signals."""
    samples = torch.cat([torch.arange(0, 5), torch.arange(500, 505)])
    return build(source, samples, torch.arange(10) % 5, torch.arange(10) % 8)


@pytest.fixture(scope="session")
def bert(tmp_path_factory):
    """A tiny BERT with random weights, written to a folder; it knows our words by pieces."""
    transformers = pytest.importorskip("transformers", reason="the extra `bert` is not installed")
    folder = tmp_path_factory.mktemp("bert")
    words = sorted({part for word in [*SYNONYMS, *SYNONYMS.values()] for part in word.split("-")})
    pieces = ["[PAD]", "[UNK]", "[CLS]", "[SEP]", "[MASK]", "-", *words]
    (folder / "vocab.txt").write_text("\n".join(pieces))
    torch.manual_seed(0)
    config = transformers.BertConfig(
        vocab_size=len(pieces), hidden_size=16, num_hidden_layers=1, num_attention_heads=2,
        intermediate_size=16,
    )  # fmt: skip
    transformers.BertModel(config).save_pretrained(folder)
    transformers.BertTokenizer(str(folder / "vocab.txt")).save_pretrained(folder)
    return str(folder)


def test_tokens_are_ones_among_zeros():
    tokens = torch.tensor([[3, EOS]])
    rows = OneHot()(tokens, torch.ones_like(tokens, dtype=torch.bool))
    assert rows.shape == (1, 2, 28) and rows.sum() == 2 and rows[0, 0, 3] == rows[0, 1, EOS] == 1


def test_an_lstm_reads_a_sequence_to_its_end_and_no_further():
    torch.manual_seed(0)
    encoder, rows = Sequence(3, 5), torch.randn(2, 6, 3)
    states = encoder(rows, torch.tensor([6, 4]))
    alone = encoder.lstm(rows[1:, :4])[0]
    torch.testing.assert_close(states[1:, :4], alone)
    assert states.shape == (2, 6, 5) and states[1, 4:].abs().max() == 0


@pytest.mark.parametrize(
    "choice", [{"language_encoder": "lstm"}, {"action_encoder": "lstm"}], ids=str
)
def test_gradients_reach_every_parameter(tiny, mixed, choice):
    torch.manual_seed(0)
    model = PTAE(replace(tiny, **choice))
    sum(model.loss(mixed)).backward()
    silent = [name for name, p in model.named_parameters() if p.grad.abs().max() < 1e-8]
    assert silent == ["encoder.attention.key.bias"]
    expected = losses(model(mixed), mixed, model.word_weights)
    torch.testing.assert_close(torch.stack(model.loss(mixed)), torch.stack(expected))


@pytest.mark.parametrize(
    "choice",
    [
        {"language_encoder": "lstm", "action_encoder": "lstm"}, {"queries": "action"},
        {"queries": "both"}, {"frame_positions": True}, {"repeat_both": True},
        {"weigh_words": True},
        {"freeze_video": True},
    ],
    ids=str,
)  # fmt: skip
def test_each_choice_is_trained_and_comes_back_from_its_file(few, tiny, tmp_path, choice):
    config = replace(tiny, **choice)
    trained = train(few, Recipe(epochs=1, batch=8), config=config)
    checkpoint.save(tmp_path / "model.safetensors", trained)
    again = checkpoint.load(tmp_path / "model.safetensors")
    assert again.model.config == config
    first, second = trained.model.state_dict(), again.model.state_dict()
    assert first.keys() == second.keys()
    assert all(torch.equal(first[name], second[name]) for name in first)


def test_repeat_both_is_drawn_where_it_is_chosen(tiny):
    assert "repeat both" in replace(tiny, repeat_both=True).mix.regular[0]
    assert all("repeat both" not in group for group in tiny.mix.regular)


@pytest.mark.extras
def test_bert_gives_a_row_a_token(bert):
    encoder = language_encoder("bert", 0, bert)
    describe, execute = (signal_index(signal) for signal in SIGNALS[:2])
    tokens = torch.tensor([
        [execute, *encode("push greenish-blue slowly")], [describe, EOS, EOS, EOS, EOS, EOS],
        [execute, *encode("push red slowly")],
    ])  # fmt: skip
    mask = torch.tensor([[True] * 6, [True] * 2 + [False] * 4, [True] * 6])
    rows = encoder(tokens, mask)
    one_hot, states = rows.split([len(TOKENS), 16], dim=2)
    assert one_hot.sum(2).tolist() == [[1, 0, 0, 0, 0, 0]] * 3  # signals alone
    assert one_hot[0, 0, execute] == one_hot[1, 0, describe] == 1
    assert (states[0].abs().amax(1) > 0).tolist() == [False] + [True] * 5
    assert (states[1].abs().amax(1) > 0).tolist() == [False, True, False, False, False, False]
    # in its sentence: the same word, another neighbour, another state
    assert not torch.equal(states[0, 2], states[2, 2])
    assert not list(encoder.parameters()) and encoder.size == len(TOKENS) + 16


@pytest.mark.extras
def test_a_model_with_bert_is_trained_and_comes_back(bert, few, tiny, tmp_path):
    config = replace(tiny, language_encoder="bert", bert=bert)
    trained = train(few, Recipe(epochs=1, batch=8), config=config)
    checkpoint.save(tmp_path / "model.safetensors", trained)
    assert checkpoint.load(tmp_path / "model.safetensors").model.config == config
    assert not [name for name in trained.model.state_dict() if "bert" in name.lower()]


@pytest.mark.extras
def test_a_folder_without_a_bert_is_refused(bert, tiny, tmp_path):
    for folder in ("", str(tmp_path)):
        with pytest.raises(ConfigError, match="holds no BERT .no config.json.; set `bert` to a"):
            PTAE(replace(tiny, language_encoder="bert", bert=folder))


def test_without_the_extra_one_sentence_says_what_to_do(tiny, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "transformers", None)
    wanted = "needs the package transformers, which is not installed; install it with"
    with pytest.raises(ConfigError, match=wanted):
        PTAE(replace(tiny, language_encoder="bert", bert=str(tmp_path)))


@pytest.mark.extras
def test_a_broken_bert_is_refused(bert, tiny, tmp_path):
    (tmp_path / "config.json").write_text("{}")
    with pytest.raises(ConfigError, match="cannot be read"):
        PTAE(replace(tiny, language_encoder="bert", bert=str(tmp_path)))
