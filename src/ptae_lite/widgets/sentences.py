"""What trainings with few labels said of some clips, as a table."""

from __future__ import annotations

from collections.abc import Sequence

import pandas as pd
from pandas.io.formats.style import Styler

from ptae_lite.language import SYNONYMS
from ptae_lite.widgets.supervision import marked

FIRST_WORD = {synonym: word for word, synonym in SYNONYMS.items()}


def table(said: pd.DataFrame, shares: Sequence[float]) -> Styler:
    """A row for each clip, a column for each share of labels; `≠` marks a wrong word.

    A synonym is shown as the word that it stands for, so that the columns can be compared.

    Args:
        said: rows of one training a share, with `truth`, `said` and `share`.
        shares: in percent.
    """
    rows = said[said["share"].isin(shares)]
    shown = rows.assign(says=[_shown(row.truth, row.said) for row in rows.itertuples()])
    made = shown.pivot(index="truth", columns="share", values="says")
    made = made.loc[list(dict.fromkeys(rows["truth"])), list(shares)]
    made.columns = [f"{share:g} %" for share in shares]
    styled = made.rename_axis("the clip shows").reset_index().style.hide(axis="index")
    return styled.set_table_styles([{"selector": "th, td", "props": "text-align: left"}])


def _shown(truth: str, said) -> str:
    words = ((FIRST_WORD.get(word, word), right) for word, right in marked(truth, said))
    return " ".join(word if right else f"≠\N{NO-BREAK SPACE}{word}" for word, right in words)
