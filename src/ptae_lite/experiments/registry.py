"""The studies by the name that the command `study` knows them by.

To add one, write a file beside these and enter it here: its docstring's first line is its help,
`add_options` declares what it understands, and `command` runs it (`book/api/extend.md`).
"""

from __future__ import annotations

from ptae_lite.experiments import (
    closed_loop,
    encoders,
    encoders_in_use,
    family,
    incongruence_table,
    recipes,
    supervision,
)

STUDIES = {
    "supervision": supervision, "recipes": recipes, "family": family, "encoders": encoders,
    "encoders-in-use": encoders_in_use, "incongruence": incongruence_table,
    "closed-loop": closed_loop,
}  # fmt: skip
