"""The stages of a full re-run, in order: one command each, with the stored files that it makes.

To add a study, add an entry to `STAGES`: a name, the command, and for each file how it is compared
with the one in `data/`.
"""

from __future__ import annotations

import re
from typing import NamedTuple

from ptae_lite.experiments import (
    closed_loop,
    conflict_examples,
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
from ptae_lite.reproduce.checks import (
    PROBED,
    SCORES,
    STRIPS,
    Check,
    arrays,
    episodes,
    pictures,
    reconstruction,
    scores,
    table,
    texts,
)


class Stage(NamedTuple):
    """One command of a re-run.

    Args:
        command: the words after `python -m`; {out}, {seeds} and {device} are filled in. Words in
            [brackets] are for a run with one seed only, which cannot compare variants.
        makes: files in the run's folder, with the same names as in `data/`, and how each is
            compared.
        minutes: its time on two free cores.
        seed_minutes: further minutes for each seed.
        minutes_of_one: its time with one seed, if a shorter command is run then.
        least_seeds: with fewer it has nothing to compare, and is left out.
        simulator: it needs PyBullet, or images that only a recording has.
        leaves: files in the run's folder that are not stored.
        lies: where the command leaves a file (not a table) that has another name in `data/`.
    """

    name: str
    command: str
    makes: dict[str, Check] = {}
    minutes: float = 1.0
    seed_minutes: float = 0.0
    minutes_of_one: float | None = None
    least_seeds: int = 1
    simulator: bool = False
    leaves: tuple[str, ...] = ()
    lies: dict[str, str] = {}

    def estimate(self, seeds: int) -> float:
        """Minutes that it takes with `seeds` seeds."""
        if seeds == 1 and self.minutes_of_one is not None:
            return self.minutes_of_one
        return self.minutes + self.seed_minutes * seeds

    def arguments(self, **values) -> list[str]:
        """The words of the command. `seeds` is a list; each of its items is a word."""
        words, kept = [], r"\1" if len(values["seeds"]) == 1 else ""
        for word in re.sub(r"\[(.*?)\]", kept, self.command).split():
            fill = values["seeds"] if word == "{seeds}" else [word.format(**values)]
            words += [str(one) for one in fill]
        return words


SCORED = {"accuracy": (10, 0), "nrmse": (0.3, 0.3)}  # how much one training differs from another
ANSWERS = {"right": (0, 0)}
SEEN = {"both|left|right": (15, 0), "_mm|error": (0, 0.3), "r2": (0.15, 0)}
ENCODERS = {  # trained as long as the stored ones; the study trains the plain one further
    "weights/cae.safetensors": "encoders/separated_3x10_seed0/encoder_128000.safetensors",
    "weights/plain_cae.safetensors": "encoders/plain_10_seed0/encoder_128000.safetensors",
}
OF_A_MACHINE = {"results/benchmarks.csv"}  # times: no stage repeats them, its book shows them
STAGES = (
    Stage("recording", "ptae_lite record --out {out}/recording", {
        "recording/samples.npz": arrays({"joints_rad": 0.01, "cubes": 0.01, "touched": 0}),
        "recording/frames.zip": pictures(2)}, 5, simulator=True),
    Stage("encoders", "ptae_lite study encoders --workers 2 --recording {out}/recording "
          "--encoders {out}/encoders --seeds {seeds} --device {device} "
          "[--no-features] --out {out}/results", {
        "results/encoders.csv": table(encoders.KEY[:4], SEEN, 0.9),
        "results/encoder_reconstructions.npz": arrays(
            dict.fromkeys((*encoders.CAES, *encoders.PCAS), 10), 0.85),
        "weights/cae.safetensors": reconstruction(0.25),
        "weights/plain_cae.safetensors": reconstruction(0.25)},
        1, 22, simulator=True, lies=ENCODERS),
    Stage("features", "ptae_lite features --data {out}/recording "
          "--encoder {out}/encoders/separated_3x10_seed0/encoder_128000.safetensors",
          {"recording/features.npz": PROBED}, 1, simulator=True),
    Stage("encoders in use", "ptae_lite study encoders-in-use --workers 2 "
          "--encoders {out}/encoders --seeds {seeds} --out {out}/results",
          {"results/encoders_in_use.csv": table(encoders_in_use.KEY, SCORED, 0.9)},
          0, 11, least_seeds=3, simulator=True),
    Stage("family", "ptae_lite study family [--core] --workers 2 "
          "--weights {out}/weights --seeds {seeds} --out {out}/results", {
        "results/family.csv": table(family.KEY, SCORED, 0.9),
        "results/family_curves.csv": table([*family.KEY, "epoch"], {"accuracy": (25, 0)}, 0.8),
        "weights/ptae.safetensors": SCORES, "weights/ptae_adam.safetensors": SCORES},
        0, 27, minutes_of_one=9,
        lies={f"weights/{name}.safetensors": f"weights/{name}_seed0.safetensors"
              for name in ("ptae", "ptae_adam")}),
    Stage("recipes", "ptae_lite study recipes --workers 2 --models ptae --modes samples "
          "--variants regular --seeds {seeds} --out {out}/results",
          {"results/recipes.csv": table(recipes.KEY, SCORED, 0.9)}, 0, 3, least_seeds=2),
    Stage("conflicts and labels",  # PTAE's curves; the whole study of labels takes hours more
          "ptae_lite.reproduce.run_parallel "
          "ptae_lite study incongruence [--models ptae ptae_adam] --workers 2 "
          "--weights {out}/weights --seeds {seeds} --out {out}/results + "
          "ptae_lite study supervision --core --models linear ptae [--modes samples] "
          "--workers 2 --weights {out}/weights --seeds {seeds} --out {out}/results", {
        "results/incongruence.csv": table(incongruence_table.KEY, SCORED, 0.8),
        "results/supervision.csv": table(supervision.KEY, SCORED, 0.9),
        "results/supervision_sentences.csv": table([*supervision.KEY, "sample"], ANSWERS, 0.7),
        "weights/ptae_labelled_5_seed0.safetensors": scores(10, 1.5),  # 33 labels say little
        "weights/ptae_labelled_20_seed0.safetensors": SCORES}, 1, 50, minutes_of_one=15),
    Stage("stories", "ptae_lite.experiments.conflict_examples --recording {out}/recording "
          "--out {out}/results", {
        "results/incongruence_examples.csv": texts(conflict_examples.KEY, "answer", 0.6),
        "results/incongruence_examples.npz": arrays({"joints": 0.05, "strips": 4}, 0.9)},
        simulator=True),
    Stage("closed loop", "ptae_lite study closed-loop [--models ptae one_look_policy] "
          "--workers 2 --weights {out}/weights --seeds {seeds} --out {out}/results", {
        "results/closed_loop.csv": table(
            [*closed_loop.KEY, "pattern", "variation"], {"^success$": (0, 0)}, 0.7),
        "results/closed_loop_models.csv": table(closed_loop.SCORES.key, SCORED, 0.8),
        "results/closed_loop_episodes.npz": episodes(0.7),
        "results/closed_loop_ptae_episodes.npz": episodes(0.7),
        "results/closed_loop_strips.npz": STRIPS,
        "weights/one_look_policy_seed0.safetensors": SCORES},
        2, 20, minutes_of_one=8, simulator=True),
    Stage("corrections",
          "ptae_lite corrections --workers 2 --out {out}/corrections", {}, 10, simulator=True,
          leaves=("corrections/clips.npz",)),
    Stage("corrections of the controls", "ptae_lite.reproduce.run_parallel "
          "ptae_lite corrections --without added-noise --workers 1 --count 648 "
          "--out {out}/corrections_no_noise + "
          "ptae_lite corrections --without disturbances --workers 1 --count 648 "
          "--out {out}/corrections_no_disturbances", {}, 9, least_seeds=3, simulator=True,
          leaves=("corrections_no_noise/clips.npz", "corrections_no_disturbances/clips.npz")),
    Stage("disturbances", "ptae_lite study disturbances --splits test --workers 2 "
          "--out {out}/results", {
        "results/disturbances.csv": table(
            disturbances.KEY, {"^(knows|unaware|valid)$": (0, 0), "_m$": (1e-4, 0)}, 0.95)},
        5, simulator=True),
    Stage("places", "ptae_lite study places --clips {out}/corrections --out {out}/results",
          {"results/places.csv": table([*places.KEY, "axis"], {"error_mm": (0.5, 0.2)}, 0.9)},
          1, simulator=True),
    Stage("controls of open eyes", "ptae_lite study watching --split held_out --workers 2 "
          "--seeds 0 --conditions moved --clips {out}/corrections --weights {out}/weights "
          "--models watching one_look_policy frozen recorded_only eighth blind_on_clips "
          "moves_only noise_only --out {out}/results", {}, 28, least_seeds=3, simulator=True,
          leaves=("weights/watching_recorded_only_fit_seed0.safetensors",)),
    Stage("planners of open eyes", "ptae_lite study watching --split test --workers 2 "
          "--models planner unaware --clips {out}/corrections --out {out}/results", {}, 9,
          least_seeds=3, simulator=True),  # `disturbances` already runs them in most of the scenes
    Stage("open eyes", "ptae_lite study watching --split test --workers 2 --seeds {seeds} "
          "--models watching one_look_policy "
          "--clips {out}/corrections --weights {out}/weights --out {out}/results", {
        "results/watching.csv": table(
            [*watching.KEY, "pattern", "variation"], {"^success$": (0, 0)}, 0.7),
        "results/watching_models.csv": table(watching.KEY[:3], SCORED, 0.8),
        "results/watching_episodes.npz": episodes(0.7),
        "results/corrected_strips.npz": STRIPS,
        "weights/watching_seed0.safetensors": SCORES}, 3, 14, simulator=True),
    Stage("book", "ptae_lite.book.site --out {out}", minutes=5,
          leaves=("html/index.html", "chapter_times.json")),
)  # fmt: skip
