"""Every claim of the paper about few labels: how it is tested, and where the book shows it."""

from __future__ import annotations

from ptae_lite.evaluation import CHANCE
from ptae_lite.experiments.supervision_grid import REGULAR
from ptae_lite.paper import reported
from ptae_lite.paper.claim_metrics import (
    IN_WORDS,
    ClaimTest,
    Notes,
    ahead,
    always,
    fall,
    number,
    of_family,
    plateau,
    with_labels,
)

FEW, OFTEN = "in_depth/04_few_labels", "in_depth/04_how_often"
FAMILY = "in_depth/03_family", "The family, side by side"
CURVES, ANCESTORS = "The paper's figures", "PTAE and its ancestors"
WITH_ADAM = "The test clips, with Adam alone"
COLOUR = "What is lost is the colour first."
LONGER = "With Adam alone, and eight times the regular updates."
REMARKS = {  # by model, task, experiment and share: on our recording, on the authors' data
    ("ptae", "describe", "iterations", 1): (f"{LONGER} What is lost is the colour.", ""),
    ("ptae", "describe", "iterations", 2): (f"{LONGER} What is lost is the colour.", ""),
    ("pgae", "describe", "iterations", 20): (
        "It is some points below with each training.", "It is below with each training.",
    ),
    ("ptae", "describe", "samples", 1): 2 * ("It is at chance with one list of three.",),
    ("ptae", "describe", "samples", 10): (COLOUR, ""),
    ("ptae", "describe", "samples", 20): (COLOUR, ""),
    ("pgae", "describe", "samples", 50): 2 * ("It does better here.",),
    ("pgae", "execute", "samples", 1): (
        "It rises, and stays below a third of that.",
        "It rises to a few times its value, and stays far below that.",
    ),
    ("pgae", "execute", "samples", 66.6): 2 * ("Here it is as with all labels.",),
}  # fmt: skip
CAVEATS = {  # of claims that hold, by the same: on our recording, on the authors' data
    ("ptae", "describe", "iterations", 1): (
        "", "With Adam alone, shown as many samples as the paper's.",
    ),
    ("ptae", "describe", "iterations", 2): ("", LONGER),
    ("ptae", "describe", "iterations", 10): (LONGER, ""),
    ("pgae", "execute", "samples", 100): ("Twice the paper's, which the margin just allows.", ""),
}  # fmt: skip


def _with_few_labels() -> list[ClaimTest]:
    """The claims with numbers for few labels, share by share, without the regular model."""
    found = []
    for (model, column, mode), by_share in reported.BY_SHARE.items():
        for share, claim in by_share.items():
            if share == REGULAR[mode] and model == "ptae":
                continue  # the same as in the first group
            task = column.split("_")[0]
            regular = share == REGULAR[mode]  # a training of the family
            seldom = mode == "iterations" and share <= 10  # a page of its own counts the uses
            key = (model, task, mode, share)
            remarks, caveats = REMARKS.get(key, ("", "")), CAVEATS.get(key, ("", ""))
            chapter, heading = (
                FAMILY if regular
                else (OFTEN, WITH_ADAM) if seldom and model == "ptae"
                else (FEW, CURVES)
            )  # fmt: skip
            found.append(number(
                f"{model.upper()}, {task} with {share:g} % of the {mode}", claim,
                of_family(column, model.upper()) if regular
                else with_labels(model, column, mode, share),
                group="Few labels", unit="%" if column.endswith("accuracy") else "% NRMSE",
                chapter=chapter, heading=heading,
                caveat=caveats[0], remark=remarks[0], theirs=Notes(caveats[1], remarks[1]),
            ))  # fmt: skip
    return found


FEW_LABELS = [
    *_with_few_labels(),
    ClaimTest(
        "Few labels",
        "PTAE, describe with 2 % of the samples",
        '"up to 50 %"; also "more than half"',
        chapter=FEW,
        heading=CURVES,
        values=with_labels("ptae", "describe_accuracy", "samples", 2),
        remark="The text names two numbers that exclude each other.",
    ),
    ClaimTest(
        "Few labels",
        "PTAE, execute stays on a plateau with 20 to 50 % of the samples",
        IN_WORDS,
        plateau("ptae", "execute_nrmse", 50, 20),
        lambda found, _: bool((found < 0.25).all()),
        "points of NRMSE above all labels",
        FEW,
        CURVES,
        trained=False,
    ),
    *(
        ClaimTest(
            "Few labels",
            f"PTAE describes better than PGAE with {share} % of the samples",
            IN_WORDS,
            ahead("describe_accuracy", "samples", share),
            always,
            "points",
            FEW,
            ANCESTORS,
            remark=remark,
        )
        for share, remark in (
            (1, "PTAE is ahead with two lists of three; from the other one neither learns."),
            (2, ""),
            (10, ""),
        )
    ),
    *(
        ClaimTest(
            "Few labels",
            f"PGAE describes above chance with {share} % of the samples",
            IN_WORDS,
            with_labels("pgae", "describe_accuracy", "samples", share),
            lambda found, _: bool((found > CHANCE).all()),
            "%",
            FEW,
            ANCESTORS,
            remark=remark,
            theirs=Notes(remark=theirs),
        )
        for share, remark, theirs in (
            (
                1,
                "It is at chance with one training of three.",
                "With one list it describes nothing.",
            ),
            (2, "", ""),
        )
    ),
    ClaimTest(
        "Few labels",
        "PGAE describes worse with 10 % of the iterations than with 20 %",
        IN_WORDS,
        fall("pgae", "describe_accuracy", "iterations", 20, 10),
        always,
        "points",
        FEW,
        ANCESTORS,
    ),
    ClaimTest(
        "Few labels",
        "PTAE, execute by iterations: a similar trend",
        "no number",
        chapter=FEW,
        heading=CURVES,
        remark="The text has no number to compare.",
    ),
]
