"""The bank of exam questions: whatever the seed, one option is right, and code agrees which."""

import math
import re
from itertools import permutations, product

import numpy as np
import pytest
import torch
from torch import nn

from ptae_lite.book import exam
from ptae_lite.errors import PTAEError

SEEDS = range(12)


def number(option):
    """The number of an option; None for one in words."""
    found = re.fullmatch(r"(?:about |practically all )?(-?[\d.e+-]+)(?: %| mm| degrees)?", option)
    return found and float(found[1])


@pytest.mark.parametrize("name", exam.BANK)
def test_each_variant_has_one_right_option_and_three_that_differ(name):
    for seed in SEEDS:
        made, order = exam.draw(name, seed)
        assert sorted(order) == sorted(made.options) and len(set(order)) == 4
        assert order.count(made.right) == 1 and made.right not in made.wrong
        numbers = [n for n in map(number, order) if n is not None]
        assert len(set(numbers)) == len(numbers), (order, "the same number twice")
        assert made.why and all(made.wrong.values())


@pytest.mark.parametrize("name", exam.BANK)
def test_seeds_give_variants_and_the_same_seed_the_same(name):
    variants = {exam.draw(name, seed)[0].text for seed in SEEDS}
    assert len(variants) > 2
    assert exam.draw(name, 3) == exam.draw(name, 3)


def test_there_are_thirty_and_each_chapter_has_some():
    assert len(exam.BANK) == 30
    assert {name[:2] for name in exam.BANK} == {f"{n:02}" for n in range(1, 8)}


def test_the_right_option_stands_at_any_place():
    places = [order.index(made.right) for made, order in map(exam.draw, exam.BANK)]
    assert set(places) == {0, 1, 2, 3}


def test_options_that_do_not_differ_are_refused(monkeypatch):
    same = exam.Question("?", "1", "because", {"1": "a", "2": "b", "3": "c"}, {})
    few = exam.Question("?", "1", "because", {"2": "b", "3": "c"}, {})
    for bad in (same, few):
        monkeypatch.setitem(exam.BANK, "09 bad", lambda draw, bad=bad: bad)
        with pytest.raises(PTAEError, match="three wrong options that differ"):
            exam.draw("09 bad")
    with pytest.raises(PTAEError, match="no question '09 none'"):
        exam.draw("09 none")


def test_the_paper_has_no_answers_and_the_key_has_all():
    paper, key = exam.paper(7), exam.answers(7)
    for name in exam.BANK:
        made, _ = exam.draw(name, 7)
        assert made.text in paper and made.why not in paper
        assert made.why in key
        for option, shows in made.wrong.items():
            assert shows not in paper and f"{option}: {shows}" in key
    assert key.count("**right.**") == 30 and paper.count("(d)") == 30


# ---------------------------------------------------------------- the answers, another way


def chain(upper, lower, turn):
    def rotation(angle):
        c, s = np.cos(np.radians(angle)), np.sin(np.radians(angle))
        return np.array([[c, -s], [s, c]])

    elbow = rotation(turn) @ [upper, 0]
    tip = (elbow + rotation(turn) @ rotation(-turn) @ [lower, 0]).round().astype(int)
    return f"({tip[0]}, {tip[1]})"


def sentences(actions, colours, speeds, words):
    words = [[(i, w) for i in range(n) for w in range(words)] for n in (actions, colours, speeds)]
    return len(set(product(*words)))


def scenes(families, colours, acts):
    return acts * sum(len(list(permutations(range(colours), 2))) for _ in range(families))


def never_trained(copies, clips):
    """By drawing: of test clips, those without a copy in training."""
    rng, movement = np.random.default_rng(0), np.arange(clips) // copies
    new = []
    for _ in range(400):
        test = rng.permutation(clips) < clips // 2
        new.append(np.mean(~np.isin(movement[test], movement[~test])))
    return 100 * np.mean(new)


def drift(error, percent, steps):
    off = 0.0
    for _ in range(steps):
        off = off * (1 - percent / 100) + error
    return off


def by_loss(a, b, share):
    angles = np.linspace(0, 100, 100_001)
    loss = share * (angles - a) ** 2 + (100 - share) * (angles - b) ** 2
    return angles[loss.argmin()]


def spread(d):
    queries, keys = np.random.default_rng(0).standard_normal((2, 20_000, d))
    return (queries * keys).sum(1).std()


def head(heads, width, keys, queries):
    parts = torch.ones(queries, heads, width // heads), torch.ones(keys, heads, width // heads)
    scores = torch.einsum("qhd,khd->hqk", *parts).softmax(-1)
    one = torch.einsum("hqk,khd->hqd", scores, parts[1])[0]
    return " x ".join(map(str, one.shape))


def frames_lost(valid):
    return 100 * torch.zeros(100).softmax(0)[valid:].sum().item()


def conv(n, k, s, p):
    return nn.Conv1d(1, 1, k, stride=s, padding=p)(torch.zeros(1, 1, n)).shape[-1]


def conv_weights(into, out, k):
    return sum(w.numel() for w in nn.Conv2d(into, out, k).parameters())


def bce(value):
    x = torch.full((8,), value, dtype=torch.float64)
    return nn.functional.binary_cross_entropy(x, x).item()


def guessed(families, colours):
    scenes = [(f, *pair) for f in range(families) for pair in permutations(range(colours), 2)]
    return 100 / len(scenes)


def best_above(seeds):
    draws = np.random.default_rng(0).random((40_000, seeds))
    return 100 * np.mean(draws.max(1) > 0.5)


def shown(labels, updates, half, clips):
    return sum(half for _ in range(updates)) / labels


AGAIN = {  # name: how the right option comes out of the numbers, and how near is right
    "01 spare joints": (
        lambda joints: joints - np.linalg.matrix_rank(np.random.default_rng(0).random((3, joints))),
        0,
    ),
    "01 a chain of two": (chain, 0),
    "01 a small language": (sentences, 0),
    "01 patterns of scenes": (scenes, 0),
    "01 copies in a test": (never_trained, 1),
    "02 size after a convolution": (conv, 0),
    "02 weights of a convolution": (conv_weights, 0),
    "02 the floor of a loss": (bce, 0.006),
    "02 a probe that guesses": (guessed, 0.06),
    "02 as many images seen": (lambda steps, batch, other: steps * batch / other, 0.6),
    "03 a softmax of two": (
        lambda a, b: torch.tensor([a, b]).log().softmax(0)[0].item(), 0.0006),
    "03 zeros behind the end": (frames_lost, 0.01),
    "03 the width of scores": (lambda d: spread(d) // 0.5 * 0.5, 0.5),
    "03 a head of several": (head, 0),
    "03 three words right": (
        lambda action, colour, speed: 100 * np.prod([action / 100, colour / 100, speed / 100]),
        0.06,
    ),
    "03 an error in percent": (lambda error, size: error / size * 100, 0.006),
    "04 how often a label is seen": (shown, 0.6),
    "04 a colour that is missing": (
        lambda labels, colours: 100 * math.prod([1 - 1 / colours] * labels), 0.06),
    "04 a label that leaks": (
        lambda share, variations: 100 - 100 * math.prod([1 - share / 100] * variations), 0.6),
    "04 supervised iterations": (lambda share, clips, epochs: clips, 0),
    "05 conflict or format": (lambda usual, agrees, conflict: conflict - agrees, 0.06),
    "05 followed by chance": (lambda colours: 100 / colours, 0.06),
    "05 between two answers": (by_loss, 0.01),
    "06 an error that adds up": (drift, 0.6),
    "06 no failure yet": (
        lambda tries: next(rate / 100 for rate in range(10_000)
                           if (1 - rate / 10_000) ** tries < 0.05), 0.06),
    "07 the best of several": (best_above, 0.7),
    "07 the noise of a score": (
        lambda hits, clips: 100 * np.std(np.r_[np.ones(hits), np.zeros(100 - hits)])
        / math.sqrt(clips), 0.06),
}  # fmt: skip


@pytest.mark.parametrize("name", AGAIN)
def test_another_computation_finds_the_right_option(name):
    again, within = AGAIN[name]
    for seed in (0, 7, 8):
        made, _ = exam.draw(name, seed)
        found = again(**made.given)
        if isinstance(found, str):
            assert found == made.right
            continue
        assert abs(number(made.right) - found) <= within + 1e-9, made.text
        others = [n for n in map(number, made.wrong) if n is not None]
        assert all(abs(other - found) > within for other in others), (made.text, found)


def test_what_is_not_computed_again_is_in_words():
    words = {"04 what a bare sentence teaches", "06 late but right", "07 a claim with a rule"}
    assert set(exam.BANK) - set(AGAIN) == words


def test_a_claims_verdict_follows_its_rule_from_both_sides():
    verdicts = set()
    for seed in range(30):
        made, _ = exam.draw("07 a claim with a rule", seed)
        g = made.given
        assert g["low"] < g["median"] < g["high"]
        assert (made.right == "held") == (g["median"] >= g["paper"] - g["margin"])
        verdicts.add(made.right)
    assert verdicts == {"held", "not held"}


def test_a_late_arm_ends_where_it_should():
    for seed in SEEDS:
        made, _ = exam.draw("06 late but right", seed)
        frames, speed = made.given["frames"], made.given["speed"]
        path = np.minimum(np.arange(200), 100) * speed / 25  # stops at frame 100
        late = path[np.maximum(np.arange(200) - frames, 0)]
        assert made.right == f"{(path - late)[90]:g} mm, then {(path - late)[-1]:g}"
