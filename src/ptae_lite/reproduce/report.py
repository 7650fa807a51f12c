"""The report of a re-run: which files agree with the stored ones, and a line that sums it up."""

from __future__ import annotations

import json
from collections import Counter
from typing import NamedTuple

from ptae_lite import artefacts
from ptae_lite.files import atomic_write
from ptae_lite.reproduce import checks, fingerprints
from ptae_lite.reproduce.rerun import Rerun
from ptae_lite.reproduce.stages import OF_A_MACHINE, Stage
from ptae_lite.reproduce.view import duration

AGREES, IN_PART, DIFFERS = "agrees", "in part", "DIFFERS"
TAKEN, NEW, MISSING = "not re-made", "new", "NOT MADE"


class Row(NamedTuple):
    """One stored file: the verdict, what was found, and the tolerance."""

    file: str
    verdict: str
    found: str
    tolerance: str


def rows(rerun: Rerun) -> list[Row]:
    """The verdict on every file that a stage makes, or that is stored."""
    stored, made, found = rerun.settings.stored, rerun.settings.data, []
    there = artefacts.manifest(stored)
    for stage in rerun.stages:
        entry = rerun.state["done"].get(stage.name, {})
        for name, check in stage.makes.items():
            if not rerun.finished(stage):
                row = (MISSING, "its stage was not finished")
            elif name not in there:
                made_now = entry["command"] != rerun.taken
                row = (NEW, "nothing is stored to compare it with") if made_now else (
                    TAKEN, f"{rerun.left_out(stage)}, and nothing is stored to take")  # fmt: skip
            elif entry["command"] == rerun.taken:
                row = (TAKEN, f"{rerun.left_out(stage)}, so it was taken from data/")
            else:
                folder = rerun.settings.out if check.key else made
                verdict = checks.judge(name, check, folder, stored)
                good = AGREES if verdict.whole else IN_PART
                says = verdict.says + ("" if verdict.whole else "; the other rows are the stored")
                row = (good if verdict.agrees else DIFFERS, says)
            found.append(Row(name, *row, check.states))
    known = {row.file for row in found} | OF_A_MACHINE
    found += [Row(name, MISSING, "no stage makes it", "") for name in there if name not in known]
    return found


def write(rerun: Rerun, failed: Stage | None = None) -> int:
    """Write `report.md` and `report.json`, and print a summary; returns 0 if all files agree."""
    found, out = rows(rerun), rerun.settings.out
    minutes = sum(entry["minutes"] for entry in rerun.state["done"].values())
    counts = Counter(row.verdict for row in found)
    others = [f"{counts[v]} {v}" for v in (IN_PART, DIFFERS, MISSING, TAKEN, NEW) if counts[v]]
    ending = ", ".join([f"{counts[AGREES]} of {len(found)} files agree", *others])
    good = not failed and not counts[DIFFERS] and not counts[MISSING]
    about = {
        "seeds": rerun.settings.seeds, "device": rerun.settings.device,
        "minutes": round(minutes, 1), "library": rerun.state["library"],
        "versions": fingerprints.versions(), "good": good,
    }  # fmt: skip
    lines = [
        "# A full re-run, held against `data/`", "",
        f"{ending}. Seeds: {about['seeds']}. Device: {about['device']}. "
        f"Time: {duration(minutes)}. "
        + ", ".join(f"{name} {version}" for name, version in about["versions"].items()) + ".", "",
        "| file | verdict | found | tolerance |", "|---|---|---|---|",
        *(f"| {' | '.join(part.replace('|', '/') for part in row)} |" for row in found), "",
        "| stage | minutes | command |", "|---|---|---|",
        *(f"| {name} | {entry['minutes']:.1f} | `{entry['command']}` |"
          for name, entry in rerun.state["done"].items()), "",
    ]  # fmt: skip
    with atomic_write(out / "report.md") as temporary:
        temporary.write_text("\n".join(lines), encoding="utf-8")
    with atomic_write(out / "report.json") as temporary:
        text = json.dumps(about | {"files": [row._asdict() for row in found]}, indent=1)
        temporary.write_text(text + "\n", encoding="utf-8")
    for row in found:
        if row.verdict != AGREES:
            print(f"{row.verdict:12} {row.file}: {row.found}")
    print(f"{ending}. The report: {out / 'report.md'}")
    return 0 if good else 1
