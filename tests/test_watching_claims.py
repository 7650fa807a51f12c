"""What chapter 06 says of the policy that watches, held against the stored tables."""

import re
from itertools import product

import numpy as np
import pandas as pd
import pytest

from ptae_lite import artefacts
from ptae_lite.experiments import watching_shown
from ptae_lite.plots.watching import correction

LITTLE = "the cube went too little that way"
AMOUNTS = ["recorded_only", "eighth", "quarter", "half", "watching"]
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
def middle(rates):
    return rates["moved"].groupby("model").median()


@pytest.fixture(scope="module")
def drawn():
    rows = pd.read_csv(artefacts.stored("results/disturbances.csv"))
    return rows[(rows["split"] == "test") & (rows["condition"] == "moved")]


def test_every_policy_acted_in_the_scenes_that_the_planners_chose(table, drawn):
    valid = drawn[drawn["valid"] == 1]
    chosen = set(zip(valid["pattern"], valid["variation"], strict=True))
    of = table[table["condition"] == "moved"].groupby(["model", "seed"])
    assert {key for key, _ in of if key[0] in AMOUNTS} == set(product(AMOUNTS, SEEDS))
    for _, rows in of:
        assert len(rows) == len(chosen)
        assert set(zip(rows["pattern"], rows["variation"], strict=True)) == chosen
    tested = table[table["condition"] == "test"].groupby(["model", "seed"]).size()
    assert (tested == 216).all()


def test_hard_moves_were_chosen_by_the_planners_alone(drawn, middle):
    assert len(drawn) == 216 and drawn["draws"].max() <= 12
    valid = drawn[drawn["valid"] == 1]
    assert valid["knows"].all() and not valid["unaware"].any()
    assert len(valid) > 0.75 * len(drawn)
    assert middle["planner"] == 100 and middle["unaware"] == 0


def test_a_first_random_move_mostly_is_no_test(drawn):
    first = (drawn["draws"] == 1) & (drawn["valid"] == 1)
    assert 0.5 < 1 - first.mean() < 0.9


def test_the_levels_that_were_asked_for_are_reached_by_every_training(rates):
    watching, blind = (rates.xs(name, level="model") for name in ("watching", "one_look_policy"))
    asked = {"test": 95, "moved": 75, "pushed": 90, "displaced": 90, "new_family": 90}
    for condition, level in asked.items():
        assert watching[condition].min() >= level, condition
    assert (watching["moved"] >= blind["moved"] + 45).all()
    assert (watching["test"] >= blind["test"] - 3).all()


def test_the_swapped_speed_word_is_obeyed(table):
    rows = table[(table["condition"] == "swapped_speed") & (table["model"] == "watching")]
    assert ((rows["duration"] >= 75) == (rows["speed"] == "slowly")).mean() >= 0.98


def test_the_one_look_policy_comes_down_where_the_cube_was_and_fails_mostly(moved, middle):
    assert middle["one_look_policy"] < 50
    share = correction(moved)
    by_model = pd.Series(share, moved.index).groupby(moved["model"]).median()
    assert abs(by_model["one_look_policy"]) < 0.15 and abs(by_model["frozen"]) < 0.15
    assert 0.85 < by_model["watching"] < 1.15 and 0.85 < by_model["planner"] < 1.15
    assert by_model["blind_on_clips"] < 0.3
    assert by_model["blind_on_clips"] < by_model["recorded_only"] < by_model["watching"]


def test_more_than_half_of_the_way_comes_from_the_frame_of_the_cube(middle):
    start, frame, whole = middle[["one_look_policy", "recorded_only", "watching"]]
    assert start < frame < whole and (frame - start) > 0.5 * (whole - start)
    assert whole - frame > 10


def test_success_rises_with_the_corrected_clips(rates, middle):
    assert middle[AMOUNTS].iloc[0] < middle[AMOUNTS].iloc[1:].min()
    assert middle["half"] <= middle["watching"] + 2 and middle["eighth"] < middle["watching"]
    ahead = rates["moved", "watching"] - rates["moved", "recorded_only"]
    assert (ahead > 0).all()


def test_clips_alone_and_joints_alone_do_not_do_it(middle):
    assert middle["blind_on_clips"] < middle["recorded_only"]
    assert middle["frozen"] < 0.3 * middle["watching"]
    assert middle["watching"] > middle[["noise_only", "moves_only"]].max()


def test_what_fails_is_mostly_a_cube_that_went_too_little(moved):
    for model in ("watching", "one_look_policy", "frozen"):
        failed = moved[(moved["model"] == model) & (moved["success"] == 0)]["reason"]
        assert failed.value_counts(normalize=True)[LITTLE] > 0.5, model


def test_places_of_moved_cubes_are_read_but_not_linearly():
    places = pd.read_csv(artefacts.stored("results/places.csv"))
    off = (places["error_mm"] ** 2).groupby([places["clips"], places["reader"]]).mean() ** 0.5
    assert off["moved", "network"] < 0.6 * off["moved", "linear"]
    assert off["moved", "linear"] < off["moved", "guess"]
    assert off["moved", "network"] < 1.6 * off["recorded", "network"]
    assert off["moved", "linear"] > 1.5 * off["recorded", "linear"]


def test_the_policy_describes_rightly_what_it_has_done(table):
    mine = table[(table["model"] == "watching") & (table["success"] == 1)]
    right = watching_shown.told_rightly(mine).groupby(mine["condition"]).mean()
    assert right["test"] >= 0.98
    assert right.drop("new_family").min() > 0.85
    slow = mine[(mine["speed"] == "slowly") & (mine["condition"] == "test")]
    told = slow["described"].str.split().str[-1]
    assert told.isin(["slowly", "unhurriedly"]).mean() > 0.95


def test_the_joint_error_is_the_same_for_policies_that_succeed_and_fail(rates):
    models = pd.read_csv(artefacts.stored("results/watching_models.csv"))
    models = models[models["split"] == "test"].set_index(["model", "seed"])["execute_nrmse"]
    error = models.groupby("model").median()
    watching = ["watching", "recorded_only", "noise_only", "moves_only"]
    assert error[watching].max() < 1.5 * error[watching].min()
    middle = rates["moved"].groupby("model").median()[watching]
    assert middle.max() - middle.min() > 20


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
