"""The report card: every claim of the paper beside the stored tables, and beside a run of yours."""

from __future__ import annotations

import numpy as np
import pandas as pd

from ptae_lite import artefacts
from ptae_lite.data.samples import Samples
from ptae_lite.evaluation import evaluate
from ptae_lite.experiments import incongruence_table
from ptae_lite.models.checkpoint import Trained
from ptae_lite.paper.claim_metrics import MARGIN, ClaimTest, Tables
from ptae_lite.paper.claims import CLAIMS

HELD, CAVEAT, NOT_HELD = "held", "held with a caveat", "not held"
NOT_TESTABLE, NOT_TRAINED = "not testable", "not trained"
NOTHING = Tables(*[pd.DataFrame()] * 5)
VERDICTS = (HELD, CAVEAT, NOT_HELD, NOT_TESTABLE, NOT_TRAINED)
ASKED = [  # the conditions that a run needs for the claims about conflicts
    condition for condition in incongruence_table.ALL
    if condition.conflict_in in ("none", "congruent") or len(condition.aspects) == 3
    or (condition.signal, condition.conflict_in) == ("repeat language", "action")
]  # fmt: skip


def stored(data: str = "recording") -> Tables:
    """The rows of one data set in the stored tables: `recording` or `authors`.

    Raises:
        ArtefactError: a table is missing or damaged.
    """
    names = ("family", "family_curves", "supervision", "incongruence", "encoders")
    found = [pd.read_csv(artefacts.stored(f"results/{name}.csv")) for name in names]
    found[-1] = found[-1].assign(data="recording")  # the authors published no image files
    tables = Tables(*(table[table["data"] == data] for table in found))
    return tables._replace(incongruence=tables.incongruence.fillna({"aspects": ""}))


def this_run(trained: Trained, samples: Samples) -> Tables:
    """The tables of one PTAE, computed now: its scores, and its answers under conflict."""
    head = {"data": samples.name, "model": "ptae", "seed": trained.about["recipe"]["seed"]}
    size = sum(p.numel() for p in trained.model.parameters())
    scores = head | {"variant": "PTAE", "parameters": size} | evaluate(trained, samples)
    answers = incongruence_table.rows_of(trained, samples, head["seed"], wanted=ASKED)
    none = pd.DataFrame()
    return Tables(pd.DataFrame([scores]), none, none, answers.assign(**head), none)


def verdict(claim: ClaimTest, tables: Tables, theirs: bool = False) -> tuple[str, str]:
    """The verdict on a claim, one of `VERDICTS`, and a sentence about it.

    Args:
        theirs: the tables are of the authors' data.
    """
    caveat, remark = claim.theirs if theirs else (claim.caveat, claim.remark)
    values = np.asarray(claim.values(tables), dtype=float)
    if claim.holds is None:
        return NOT_TESTABLE, claim.remark
    if not len(values):
        return NOT_TRAINED, remark
    one = "One training." if len(values) == 1 and claim.trained else ""
    if claim.holds(values, tables):
        why = " ".join(filter(None, (caveat, one)))
        return CAVEAT if why else HELD, why
    return NOT_HELD, " ".join(filter(None, (remark, one)))


def card(ours: Tables, theirs: Tables = NOTHING, run: Tables | None = None) -> pd.DataFrame:
    """The card as text, a row for each claim: its numbers, its verdicts, and where to look.

    `ours`, `theirs` and `this run` are the median of the trainings, with the lowest and the
    highest. `verdict` and `why` are of our recording, `verdict_theirs` and `why_theirs` of the
    authors' data.

    Args:
        ours: of our recording.
        theirs: of the authors' data.
        run: of a single model, see `this_run`.
    """
    rows = []
    for claim in CLAIMS:
        (judged, why), (judged_theirs, why_theirs) = both(claim, ours, theirs)
        rows.append({
            "group": claim.group, "claim": claim.says, "paper": claim.paper,
            "theirs": written(claim, claim.values(theirs)),
            "ours": written(claim, claim.values(ours)),
            "this run": "" if run is None else written(claim, claim.values(run)),
            "verdict_theirs": judged_theirs, "why_theirs": why_theirs,
            "verdict": judged, "why": why, "chapter": claim.chapter, "heading": claim.heading,
        })  # fmt: skip
    return pd.DataFrame(rows)


def both(claim: ClaimTest, ours: Tables, theirs: Tables) -> tuple[tuple[str, str], ...]:
    """The verdicts on both data sets, as `verdict` has them."""
    return verdict(claim, ours), verdict(claim, theirs, theirs=True)


def measured(ours: Tables, theirs: Tables = NOTHING, run: Tables | None = None) -> pd.DataFrame:
    """The card in numbers, for figures: a row for each claim.

    `paper` and `reads` are the paper's number and its direction; `low`, `median`, `high` and
    `verdict` are of our recording, those with `_theirs` of the authors' data, and `run` is that of
    a single model. What there is none of is NaN.

    Args:
        ours, theirs, run: see `card`.
    """
    rows = []
    for claim in CLAIMS:
        paper, reads = (claim.number.value, claim.number.reads) if claim.number else (np.nan, "")
        (judged, _), (judged_theirs, _) = both(claim, ours, theirs)
        own = np.asarray([] if run is None else claim.values(run), dtype=float)
        rows.append({
            "group": claim.group, "claim": claim.says, "unit": claim.unit, "paper": paper,
            "reads": reads, "margin": MARGIN.get(claim.unit, np.nan),
            **_range(claim, ours), **_range(claim, theirs, "_theirs"),
            "run": np.median(own) if len(own) else np.nan,
            "verdict": judged, "verdict_theirs": judged_theirs,
        })  # fmt: skip
    return pd.DataFrame(rows)


def _range(claim: ClaimTest, tables: Tables, suffix: str = "") -> dict[str, float]:
    values = np.asarray(claim.values(tables), dtype=float)
    found = np.quantile(values, (0, 0.5, 1)) if len(values) else [np.nan] * 3
    return {
        f"{name}{suffix}": one for name, one in zip(("low", "median", "high"), found, strict=True)
    }


def written(claim: ClaimTest, values) -> str:
    """Median and range of a claim's values, and how many there are; empty if there are none."""
    values = np.asarray(values, dtype=float) + 0.0  # no -0.0
    if not len(values):
        return ""
    middle, low, high = (
        f"{value:.{claim.digits}f}" for value in (np.median(values), values.min(), values.max())
    )
    text = f"{middle} {claim.unit}"
    of = "trained" if claim.trained else "values"
    return text if len(values) == 1 else f"{text} ({low} to {high}; {len(values)} {of})"
