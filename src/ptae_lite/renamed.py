"""Old names and the new ones, for messages about an old name."""

from __future__ import annotations

from collections.abc import Iterable

OPTIONS = {"--eye": "--encoder", "--eyes": "--encoders"}
VALUES = {  # of studies, models, variants and recipes
    "eyes": "encoders",
    "eyes-ptae": "encoders-in-use",
    "blind": "one_look_policy",
    "first frame": "ptae_first_frame",
    "no padding": "ptae_no_padding",
    "open eyes": "watching_policy",
    "noise": "noisy_video",
    "aggregated": "dagger",
    "PTAE, clock": "PTAE, frame positions",
    "PTAE, first frame only": "PTAE, frozen video",
    "PTAE, no blends": "PTAE, no mixup",
    "PTAE, words weighed": "PTAE, class-weighted words",
    "PTAE, action asks": "PTAE, action as query",
    "unpaired": "shuffled-scenes",
    "unblended": "no-mixup",
    "one-pace": "one-learning-rate",
}
SETTINGS = {  # of configurations and recipes, as `--set` and weights have them
    "film": "freeze_video",
    "clock": "frame_positions",
    "padded": "pad_still_frame",
    "reminded": "condition_on_code",
    "action_pace": "action_lr_scale",
    "hold": "hold_steps",
    "extra": "p_congruent_input",
    "unpaired": "shuffle_scenes",
}
COLUMNS = {  # of tables, and arrays in npz files
    "eye": "encoder",
    "presentations": "samples_seen",
    "supervised_presentations": "supervised_samples_seen",
    "follows": "source",
    "execute_film_frozen": "execute_video_frozen",
}


def said_of(found: Iterable[str], names: dict[str, str]) -> str:
    """A message with the old names among `found` and their new names; empty if there are none."""
    return ", ".join(f"{name!r} is now called {names[name]!r}" for name in found if name in names)
