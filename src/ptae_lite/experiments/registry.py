"""The studies, by the name that the command `study` uses.

To add one, write a file beside these and enter it here. The first line of its docstring is its
help, `add_options` declares its options, and `command` runs it (`book/api/extend.md`).
"""

from __future__ import annotations

from ptae_lite.experiments import (
    closed_loop,
    disturbances,
    encoders,
    encoders_in_use,
    family,
    incongruence_table,
    places,
    recipes,
    supervision,
    watching,
)

STUDIES = {
    "supervision": supervision, "recipes": recipes, "family": family, "encoders": encoders,
    "encoders-in-use": encoders_in_use, "incongruence": incongruence_table,
    "closed-loop": closed_loop, "disturbances": disturbances, "places": places,
    "watching": watching,
}  # fmt: skip
