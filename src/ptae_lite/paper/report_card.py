"""The report card: every claim of the paper beside the stored tables, and beside a run of yours."""

from __future__ import annotations

import numpy as np
import pandas as pd

from ptae_lite import artefacts
from ptae_lite.data.samples import Samples
from ptae_lite.evaluation import evaluate
from ptae_lite.experiments import incongruence_table
from ptae_lite.experiments.supervision import VARIANTS
from ptae_lite.models.checkpoint import Trained
from ptae_lite.paper.claim_metrics import MARGIN, ClaimTest, Tables
from ptae_lite.paper.claims import CLAIMS

HELD, CAVEAT, NOT_HELD = "held", "held with a caveat", "not held"
NOT_TESTABLE = "not testable"
LONGER = f"{VARIANTS['long'].times} times the updates bring it"
VERDICTS = (HELD, CAVEAT, NOT_HELD, NOT_TESTABLE)
ASKED = [  # the conditions that a run needs for the claims about conflicts
    condition for condition in incongruence_table.ALL
    if condition.conflict_in in ("none", "congruent") or len(condition.aspects) == 3
    or (condition.signal, condition.conflict_in) == ("repeat language", "action")
]  # fmt: skip


def stored() -> Tables:
    """The stored tables; of each, the rows of our recording.

    Raises:
        ArtefactError: a table is missing or damaged.
    """
    names = ("family", "family_curves", "supervision", "incongruence", "encoders")
    found = [pd.read_csv(artefacts.stored(f"results/{name}.csv")) for name in names]
    own = [table[table["data"] == "recording"] if "data" in table else table for table in found]
    tables = Tables(*own)
    return tables._replace(incongruence=tables.incongruence.fillna({"aspects": ""}))


def this_run(trained: Trained, samples: Samples) -> Tables:
    """The tables of one PTAE, computed now: its scores, and its answers under conflict."""
    head = {"data": samples.name, "model": "ptae", "seed": trained.about["recipe"]["seed"]}
    size = sum(p.numel() for p in trained.model.parameters())
    scores = head | {"variant": "PTAE", "parameters": size} | evaluate(trained, samples)
    answers = incongruence_table.rows_of(trained, samples, head["seed"], wanted=ASKED)
    none = pd.DataFrame()
    return Tables(pd.DataFrame([scores]), none, none, answers.assign(**head), none)


def verdict(claim: ClaimTest, tables: Tables) -> tuple[str, str]:
    """The verdict on a claim, one of `VERDICTS`, and a sentence about it."""
    values = np.asarray(claim.values(tables), dtype=float)
    if claim.holds is None:
        return NOT_TESTABLE, claim.remark
    if not len(values):
        return NOT_TESTABLE, "These trainings are not in the table yet."
    one = "One training." if len(values) == 1 and claim.trained else ""
    if claim.holds(values, tables):
        why = " ".join(filter(None, (claim.caveat, one)))
        return CAVEAT if why else HELD, why
    if claim.longer is None:
        return NOT_HELD, " ".join(filter(None, (claim.remark, one)))
    short, long = claim.longer(tables)
    if not len(long):
        return NOT_TESTABLE, "It was not trained longer, and with so few labels that may matter."
    if claim.holds(np.asarray(long), tables):
        return NOT_TESTABLE, f"{LONGER} there, in the trainings that are as long."
    nearer = (long - short).mean() * (1 if claim.upwards else -1)
    if nearer > MARGIN.get(claim.unit, MARGIN["%"]):
        unit = "points" if claim.unit == "%" else claim.unit
        return NOT_TESTABLE, f"{LONGER} {nearer:.0f} {unit} nearer; more was not tried."
    return NOT_HELD, " ".join(filter(None, (claim.remark, f"{LONGER} hardly nearer.", one)))


def card(tables: Tables, run: Tables | None = None) -> pd.DataFrame:
    """A row for each claim: the paper's number, ours, this run's, the verdict, and where to look.

    `ours` is the median of the trainings, with the lowest and the highest. The verdict is that of
    the tables, not of the run.
    """
    rows = []
    for claim in CLAIMS:
        judged, why = verdict(claim, tables)
        rows.append({
            "group": claim.group, "claim": claim.says, "paper": claim.paper,
            "ours": written(claim, claim.values(tables)),
            "this run": "" if run is None else written(claim, claim.values(run)),
            "verdict": judged, "why": why, "chapter": claim.chapter, "heading": claim.heading,
        })  # fmt: skip
    return pd.DataFrame(rows)


def measured(tables: Tables, run: Tables | None = None) -> pd.DataFrame:
    """The card in numbers, for figures: a row for each claim.

    `paper` and `reads` are the paper's number and its direction; `low`, `median` and `high` are of
    our trainings, `run` is that of a single run. What there is none of is NaN.
    """
    rows = []
    for claim in CLAIMS:
        values = np.asarray(claim.values(tables), dtype=float)
        own = np.asarray([] if run is None else claim.values(run), dtype=float)
        low, middle, high = np.quantile(values, (0, 0.5, 1)) if len(values) else [np.nan] * 3
        paper, reads = (claim.number.value, claim.number.reads) if claim.number else (np.nan, "")
        rows.append({
            "group": claim.group, "claim": claim.says, "unit": claim.unit, "paper": paper,
            "reads": reads, "margin": MARGIN.get(claim.unit, np.nan), "low": low,
            "median": middle, "high": high, "run": np.median(own) if len(own) else np.nan,
            "verdict": verdict(claim, tables)[0],
        })  # fmt: skip
    return pd.DataFrame(rows)


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
