"""What chapter 06 says of the policy that watches, held against the stored tables."""

import re
from itertools import product
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from ptae_lite import artefacts, vision
from ptae_lite.data.samples import load_samples
from ptae_lite.experiments import watching_shown
from ptae_lite.experiments.tasks import tasks_of
from ptae_lite.experiments.watching import CLIPS
from ptae_lite.language import parse
from ptae_lite.models import checkpoint
from ptae_lite.plots.watching import correction
from ptae_lite.reproduce.stages import STAGES
from ptae_lite.robot.scene import Scene
from ptae_lite.watching_actor import WatchingActor

BOOK = Path(__file__).resolve().parents[1] / "book"
LITTLE = "the cube went too little that way"
AMOUNTS = ["recorded_only", "eighth", "watching"]
LEVELS = {"test": 95, "moved": 75, "pushed": 90, "displaced": 90, "new_family": 90,
          "swapped_speed": 98}  # fmt: skip
SEEDS = (0, 1, 2)


@pytest.fixture(scope="module")
def whole():
    return pd.read_csv(artefacts.stored("results/watching.csv"))


@pytest.fixture(scope="module")
def table(whole):
    return whole[whole["split"] == "test"]


@pytest.fixture(scope="module")
def rates(table):
    return 100 * table.groupby(["condition", "model", "seed"])["success"].mean()


@pytest.fixture(scope="module")
def moved(table):
    return table[table["condition"] == "moved"]


@pytest.fixture(scope="module")
def held(whole):
    """The controls: one training each, in held-out scenes where a cube is moved."""
    mine = (whole["split"] == "held_out") & (whole["condition"] == "moved") & (whole["seed"] == 0)
    return whole[mine]


@pytest.fixture(scope="module")
def controls(held):
    return 100 * held.groupby("model")["success"].mean()


@pytest.fixture(scope="module")
def drawn():
    rows = pd.read_csv(artefacts.stored("results/disturbances.csv"))
    return rows[(rows["split"] == "test") & (rows["condition"] == "moved")]


def share_of_the_way(rows) -> pd.Series:
    """The median of the hand's correction, by model."""
    return pd.Series(correction(rows), rows.index).groupby(rows["model"]).median()


def test_every_policy_acted_in_the_scenes_that_the_planners_chose(table, drawn):
    valid = drawn[drawn["valid"] == 1]
    chosen = set(zip(valid["pattern"], valid["variation"], strict=True))
    of = table[table["condition"] == "moved"].groupby(["model", "seed"])
    assert {key for key, _ in of} >= set(product(["watching", "one_look_policy"], SEEDS))
    for _, rows in of:
        assert len(rows) == len(chosen)
        assert set(zip(rows["pattern"], rows["variation"], strict=True)) == chosen
    tested = table[table["condition"] == "test"].groupby(["model", "seed"]).size()
    assert (tested == 216).all()


def test_hard_moves_were_chosen_by_the_planners_alone(drawn, rates):
    assert len(drawn) == 216 and drawn["draws"].max() <= 12
    valid = drawn[drawn["valid"] == 1]
    assert valid["knows"].all() and not valid["unaware"].any()
    assert len(valid) > 0.75 * len(drawn)
    assert rates["moved", "planner", 0] == 100 and rates["moved", "unaware", 0] == 0


def test_a_first_random_move_mostly_is_no_test(drawn):
    first = (drawn["draws"] == 1) & (drawn["valid"] == 1)
    assert 0.5 < 1 - first.mean() < 0.9


def test_every_training_reaches_the_levels(rates):
    watching, blind = (rates.xs(name, level="model") for name in ("watching", "one_look_policy"))
    for condition, level in LEVELS.items():
        assert watching[condition].min() >= level, condition
    assert (watching["moved"] >= blind["moved"] + 45).all()
    assert (watching["test"] >= blind["test"] - 3).all()
    assert (watching["new_family"] > blind["new_family"]).all()


def test_the_swapped_speed_word_is_obeyed(table):
    rows = table[(table["condition"] == "swapped_speed") & (table["model"] == "watching")]
    assert ((rows["duration"] >= 75) == (rows["speed"] == "slowly")).mean() >= 0.98


def test_the_one_look_policy_comes_down_where_the_cube_was_and_fails_mostly(moved, rates):
    assert rates["moved", "one_look_policy"].max() < 50
    went = share_of_the_way(moved)
    assert abs(went["one_look_policy"]) < 0.15
    assert 0.85 < went["watching"] < 1.15 and 0.85 < went["planner"] < 1.15


def test_the_frame_of_the_cube_does_much_and_clips_the_rest(held, controls):
    assert controls["one_look_policy"] + 30 < controls["recorded_only"]
    assert controls["recorded_only"] + 10 < controls["watching"]
    went = share_of_the_way(held)
    assert abs(went["frozen"]) < 0.1 and abs(went["blind_on_clips"]) < 0.1
    assert 0.15 < went["recorded_only"] < 0.4 < 0.6 < went["eighth"] < went["watching"]
    assert went["noise_only"] < 0.4 and went["moves_only"] > 0.85


def test_success_rises_with_the_corrected_clips(controls):
    assert controls[AMOUNTS].is_monotonic_increasing


def test_clips_alone_and_a_frozen_video_do_not_do_it(controls):
    assert controls[["blind_on_clips", "frozen"]].max() < 0.3 * controls["watching"]


def test_what_fails_is_mostly_a_cube_that_went_too_little(moved, held):
    for model in ("recorded_only", "frozen", "blind_on_clips"):
        failed = held[(held["model"] == model) & (held["success"] == 0)]["reason"]
        assert failed.value_counts(normalize=True)[LITTLE] > 0.9, model
    failed = moved[(moved["model"] == "one_look_policy") & (moved["success"] == 0)]["reason"]
    assert failed.value_counts(normalize=True)[LITTLE] > 0.9


def test_places_of_moved_cubes_are_read_but_not_linearly():
    places = pd.read_csv(artefacts.stored("results/places.csv"))
    off = (places["error_mm"] ** 2).groupby([places["clips"], places["reader"]]).mean() ** 0.5
    assert off["moved", "network"] < 0.6 * off["moved", "linear"]
    assert off["moved", "linear"] < off["moved", "guess"]
    assert off["moved", "linear"] > 1.5 * off["recorded", "linear"]


def test_the_policy_describes_rightly_what_it_has_done(table):
    mine = table[(table["model"] == "watching") & (table["success"] == 1)]
    right = watching_shown.told_rightly(mine).groupby([mine["condition"], mine["seed"]]).mean()
    assert right["test"].min() >= 0.98
    middle = right.groupby("condition").median()
    assert middle[["pushed", "swapped_speed"]].min() > 0.95
    assert middle["new_family"] < middle["moved"] < middle["test"]
    assert 0.6 < middle["new_family"] < 0.72  # a third is called wrongly
    for speed, words in (("slowly", ["slowly", "unhurriedly"]), ("fast", ["fast", "quickly"])):
        told = mine[mine["speed"] == speed]["described"].str.split().str[-1]
        assert told.isin(words).mean() > 0.99


def test_the_joint_error_is_the_same_for_policies_that_succeed_and_fail(controls):
    models = pd.read_csv(artefacts.stored("results/watching_models.csv"))
    error = models[(models["split"] == "held_out") & (models["seed"] == 0)].set_index("model")
    error = error["execute_nrmse"][AMOUNTS]
    assert error.max() < 1.2 * error.min()
    assert controls[AMOUNTS].max() - controls[AMOUNTS].min() > 10


def test_a_success_without_corrected_clips_is_often_a_near_miss(held):
    far = held.groupby("model")["named_mm"].median()
    assert 40 < far["recorded_only"] < far["watching"] - 10
    assert far[["frozen", "blind_on_clips"]].max() < 40


def test_the_joint_error_is_smallest_without_corrected_clips():
    models = pd.read_csv(artefacts.stored("results/watching_models.csv"))
    error = models[(models["split"] == "held_out") & (models["seed"] == 0)].set_index("model")
    assert error.loc[AMOUNTS, "execute_nrmse"].idxmin() == "recorded_only"


def test_what_is_told_wrongly_is_the_action_of_a_moved_cube_and_the_colour_in_new_families(table):
    mine = table[table["model"] == "watching"]
    wrong = mine[~watching_shown.told_rightly(mine)]
    for condition, part in (("moved", "action"), ("new_family", "colour")):
        rows = wrong[wrong["condition"] == condition]
        said = [(parse(one.described), parse(one.sentence)) for one in rows.itertuples()]
        assert len(said) > 5 and all(a.speed == b.speed for a, b in said)
        assert sum(getattr(a, part) != getattr(b, part) for a, b in said) > 0.8 * len(said)


def test_in_new_families_the_first_look_finds_the_named_cube(simulator, table):
    """PTAE never saw these pairs of colours; each colour by itself is known."""
    samples = load_samples("recording")
    encoder = vision.load_autoencoder(artefacts.stored("weights/cae.safetensors"))
    trained = checkpoint.load(artefacts.stored("weights/watching_seed0.safetensors"))
    rows = table[(table["model"] == "watching") & (table["condition"] == "new_family")]
    done = rows[rows["seed"] == 0]["success"]
    for task, well in zip(tasks_of(samples, "new_family"), done, strict=True):
        with Scene(*task.stage) as world:
            actor = WatchingActor(trained, encoder, task.instruction)
            actor(world.image, world.joints_rad())
        found = actor.task == (task.asked.side, task.asked.action, task.asked.speed)
        assert found or not well


def test_beyond_the_test_only_the_light_harms(table):
    mine = table[table["model"] == "watching"].groupby(["condition", "seed"])["success"].mean()
    assert mine["moved"].min() == mine["pushed"].min() == 1
    assert mine[["late", "slippery", "heavy", "synonyms"]].min() > 0.9
    assert 0.5 < mine["dark"].max() < 0.95


def test_the_stored_episodes_are_those_that_the_chapter_names():
    acted = watching_shown.load()
    assert len(acted) == 48 and {one.model for one in acted} == set(watching_shown.ACTING)
    assert all((one.kept.episode.event >= 0) == one.moved for one in acted)
    shown = watching_shown.find(acted, "one_look_policy", True, "slide red slowly")
    assert not shown.verdict.success and shown.verdict.reason == LITTLE
    other = watching_shown.find(acted, "watching", True, "slide red slowly")
    assert other.verdict.success
    done = [one.kept.verdict.success for one in acted if one.model == "watching" and one.moved]
    blind = [one.kept.verdict.success for one in acted
             if one.model == "one_look_policy" and one.moved]  # fmt: skip
    assert sum(done) > sum(blind) + 5


def test_film_strips_are_of_training_patterns():
    with np.load(artefacts.stored("results/corrected_strips.npz"), allow_pickle=False) as file:
        texts = file["texts"].tolist()
    assert [re.sub(r".*: ", "", text) for text in texts] == list(watching_shown.KINDS)


def test_the_book_made_anew_has_the_rows_that_its_pages_name():
    commands = [one.command for one in STAGES if "study watching" in one.command]
    made = {word for command in commands for word in command.split()}
    pages = [BOOK / "06_closed_loop.md", BOOK / "in_depth" / "06_open_eyes.md"]
    named = re.findall(
        r'(?:kept|along)\["(\w+)"\]', "".join(one.read_text("utf-8") for one in pages)
    )
    assert {"recorded_only", "noise_only"} <= set(named) <= made
    folders = " ".join(one.command for one in STAGES)
    for clips, suffix in CLIPS.items():
        assert f"corrections{suffix} " in f"{folders} ", clips
