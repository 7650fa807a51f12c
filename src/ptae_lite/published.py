"""The numbers that the paper's running text states, each with where it stands.

Only what is written out is here; nothing is read off from a figure. The text states no seeds, no
spread and no repeats. PTAE: arXiv 2301.03353.
"""

from __future__ import annotations

from typing import NamedTuple


class Claim(NamedTuple):
    """One number of the paper."""

    value: float  # percent
    says: str  # how exactly the text puts it
    section: str


REGULAR = {
    "describe_accuracy": Claim(100.0, "describe without conflict", "conflict results"),
    "repeat_language_accuracy": Claim(
        100.0, "repeat language without conflict", "conflict results"
    ),
    "execute_nrmse": Claim(0.99, "execute without conflict", "conflict results"),
    "repeat_action_nrmse": Claim(1.03, "repeat action without conflict", "conflict results"),
}

# Describe accuracy of PTAE by the share of labelled samples in percent.
DESCRIBE_BY_SAMPLES = {
    1: Claim(33.0, "about 33 %", "limited samples results"),
    10: Claim(81.0, "about 81 % where more than 90 % is unimodal", "limited samples results"),
    20: Claim(100.0, "no drop", "limited samples results"),
    50: Claim(100.0, "no drop", "limited samples results"),
    100: Claim(100.0, "the regular model", "limited samples results"),
}
# At 2 % the text says "up to 50 %" in one place and more than half in another: no one number.

# By the number of conflicts in the extra input, as far as the text has numbers.
_NOTHING_LEFT = Claim(0.0, "accuracy is 0 % with one conflict or more", "conflict results")
CONFLICTS = {
    "describe": {
        0: REGULAR["describe_accuracy"],
        3: Claim(95.0, "accuracy falls from 100 to 95 %", "conflict results"),
    },
    "repeat language": {0: REGULAR["repeat_language_accuracy"]}
    | dict.fromkeys((1, 2, 3), _NOTHING_LEFT),
    "execute": {
        0: REGULAR["execute_nrmse"],
        3: Claim(4.95, "NRMSE rises from 0.99 to 4.95 %", "conflict results"),
    },
    "repeat action": {
        0: REGULAR["repeat_action_nrmse"],
        3: Claim(1.09, "NRMSE rises from 1.03 to 1.09 %", "conflict results"),
    },
}

# What the text says of PGAE, the model before, on the same data.
PGAE = {
    "execute_nrmse": Claim(0.5, "below 0.5 % in the regular training", "limited samples results"),
}

# The published code's training, and what a step of it takes: 99 single-step calls through the
# layers, measured on one thread of this book's test machine with the published classes.
STEPS = {"ptae": 270_000, "pgae": 648_000}  # batches of 6
SECONDS_A_STEP = {"ptae": 0.14, "pgae": 0.25}
