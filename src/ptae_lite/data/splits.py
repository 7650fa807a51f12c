"""Which patterns are for what: to train, to choose settings on, and for the final number."""

from __future__ import annotations

from collections import Counter

from ptae_lite.errors import ConfigError
from ptae_lite.language import MEANINGS, SIDES, patterns


def _by_meaning() -> dict:
    """The training patterns of each meaning: three each, in order of the first."""
    groups: dict = {}
    for p in patterns():
        if p.split == "train":
            groups.setdefault(p.meaning, []).append(p.index)
    return groups


def _splits() -> dict[str, tuple[int, ...]]:
    """Pattern indices by split.

    Held out is what asks of a model the same as the test does. A test pattern's meaning is known
    from three others, one of them on the same side; and many lie in arrangements that training
    shows half as often as others. So: of the arrangements that training shows most, every second
    pattern whose meaning it has on the same side elsewhere.
    """
    of = {name: tuple(p.index for p in patterns() if p.split == name) for name in ("train", "test")}
    train = [pattern for pattern in patterns() if pattern.split == "train"]
    shown = Counter(p.arrangement for p in train)
    alike = Counter((p.meaning, p.side) for p in train)
    held_out = []
    for arrangement, count in shown.items():
        if count == max(shown.values()):
            known = [p for p in train if p.arrangement == arrangement]
            held_out += [p.index for p in known if alike[p.meaning, p.side] == 2][::2]
    fit = tuple(i for i in of["train"] if i not in held_out)
    return of | {"held_out": tuple(sorted(held_out)), "fit": fit}


SPLITS = _splits()
HOLDOUT_STEP = 7  # through the 36 meanings: any six in a row differ in colour


def holdout_patterns(count: int) -> tuple[int, ...]:
    """The training patterns that stand in for a test part that a data set does not have.

    One pattern each of the first `count` meanings, in steps of seven through `MEANINGS`, so that
    every six have all colours, each action twice and each speed three times. Of a meaning's three
    training patterns it is the first that `held_out` does not use, so settings can be chosen as
    ever; two on the left, then two on the right, where there is a choice. Every sentence keeps a
    pattern to learn it from, as in the paper's own split. A smaller count is part of a larger one.

    Raises:
        ConfigError: `count` is not 1 to 36.
    """
    if not 1 <= count <= len(MEANINGS):
        raise ConfigError(
            f"{count} held-out patterns: it is 1 to {len(MEANINGS)}, at most one for each meaning"
        )
    groups, chosen = _by_meaning(), []
    for i in range(count):
        group = groups[MEANINGS[HOLDOUT_STEP * i % len(MEANINGS)]]
        free = [index for index in group if index not in SPLITS["held_out"]]
        side = SIDES[i // 2 % 2]
        chosen.append(min(free, key=lambda index, side=side: patterns()[index].side != side))
    return tuple(sorted(chosen))


def patterns_of(split: str, holdout: int | None = None) -> tuple[int, ...]:
    """Patterns of a split; with `holdout`, that many training patterns are the `test` part.

    Raises:
        ConfigError: there is no such split, or `holdout` is not 1 to 36.
    """
    if split not in SPLITS:
        raise ConfigError(f"no split {split!r}; there are {', '.join(SPLITS)}")
    if holdout is None:
        return SPLITS[split]
    aside = holdout_patterns(holdout)
    return aside if split == "test" else tuple(i for i in SPLITS[split] if i not in aside)
