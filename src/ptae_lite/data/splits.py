"""Which patterns are used to train, to choose settings, and to compute the final scores."""

from __future__ import annotations

from collections import Counter

from ptae_lite.errors import ConfigError
from ptae_lite.language import MEANINGS, SIDES, patterns


def _by_meaning() -> dict:
    """The three training patterns of each meaning, in index order."""
    groups: dict = {}
    for p in patterns():
        if p.split == "train":
            groups.setdefault(p.meaning, []).append(p.index)
    return groups


def _splits() -> dict[str, tuple[int, ...]]:
    """Pattern indices by split.

    The held-out patterns should be as hard as the test patterns. Training shows the meaning of a
    test pattern in three others, one of them on the same side, and it shows many of the
    arrangements half as often as others. So we take the arrangements that training shows most
    often, find their patterns whose meaning training also shows on the same side elsewhere, and
    hold out every second one.
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
    """The training patterns that replace a test part that a data set does not have.

    There is one pattern for each of the first `count` meanings, in steps of seven through
    `MEANINGS`: any six in a row then have all colours, each action twice and each speed three
    times. A meaning has three training patterns. We take the first that is not in `held_out`, so
    that settings can still be chosen on `held_out`. Where there is a choice, two patterns on the
    left follow two on the right. Training keeps at least one pattern of each sentence, as in the
    paper's split. The patterns of a small `count` are also among those of a larger one.

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
    """Pattern indices of a split. With `holdout`, that many training patterns are the `test` part.

    Raises:
        ConfigError: there is no such split, or `holdout` is not 1 to 36.
    """
    if split not in SPLITS:
        raise ConfigError(f"no split {split!r}; there are {', '.join(SPLITS)}")
    if holdout is None:
        return SPLITS[split]
    aside = holdout_patterns(holdout)
    return aside if split == "test" else tuple(i for i in SPLITS[split] if i not in aside)
