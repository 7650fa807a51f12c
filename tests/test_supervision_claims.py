"""What chapter 04 says of limited supervision, held against the stored table."""

import pandas as pd
import pytest

from ptae_lite import artefacts
from ptae_lite.display import shares
from ptae_lite.evaluation import CHANCE

ACTION_WORD = 7.1  # execute NRMSE of the mean motion of the action word; the chapter prints it
WORDS = ["action_accuracy", "colour_accuracy", "speed_accuracy"]


@pytest.fixture(scope="module")
def table():
    found = pd.read_csv(artefacts.stored("results/supervision.csv"))
    return found[found["data"] == "recording"]


@pytest.fixture(scope="module")
def ptae(table):
    return shares.rows_of(table, "ptae", "samples")


@pytest.fixture(scope="module")
def linear(table):
    return table[table["model"] == "linear"]


def test_describe_falls_with_the_labels_and_stays_above_chance(ptae):
    accuracy = ptae.groupby("share")["describe_accuracy"].mean()
    assert accuracy.loc[[1, 2, 5, 10, 20, 50]].is_monotonic_increasing
    assert accuracy[2] < 35 and (ptae["describe_accuracy"] > CHANCE).all()


def test_execute_holds_out_longer(ptae):
    error = ptae.groupby("share")["execute_nrmse"].mean()
    assert 1.1 < error[10] / error[100] < 1.3
    for share in (2, 5):
        assert 1.9 < error[share] / error[100] < 2.2
        assert 0.4 < error[share] / ACTION_WORD < 0.6
    assert 0.7 < error[1] / ACTION_WORD < 1


def test_few_iterations_cost_less_than_few_samples(table, ptae):
    few = shares.rows_of(table, "ptae", "iterations").groupby("share")["describe_accuracy"].mean()
    samples = ptae.groupby("share")["describe_accuracy"].mean()
    assert (few[[2, 10, 20]] > samples[[2, 10, 20]] + 9).all()
    assert few[10] > 90 and samples[10] < 65
    assert few[[10, 20, 50]].between(90, 98).all()


def test_the_repeat_signals_notice_nothing(ptae):
    assert (ptae["repeat_language_accuracy"] == 100).all()
    assert ptae["repeat_action_nrmse"].between(1.6, 1.9).all()


def test_from_the_same_labels_ptae_describes_hardly_better_than_weighted_sums(ptae, linear):
    random = linear[linear["variant"] == "random"].set_index(["share", "seed"])
    mine = ptae[ptae["share"] < 100].set_index(["share", "seed"])["describe_accuracy"]
    ahead = mine - random["describe_accuracy"].reindex(mine.index)
    assert ahead.min() > -9 and ahead.max() < 6
    assert {share for share, _ in ahead[ahead < -2.5].index} == {5, 10, 20}
    assert {share for share, _ in ahead[ahead > 0].index} == {1, 2, 50, 66.6}


def test_at_ten_percent_ptae_is_below_the_worst_of_twenty_weighted_sums(ptae, linear):
    draws = linear[(linear["share"] == 10) & (linear["variant"] == "random")]
    assert len(draws) == 20
    mine = ptae[(ptae["share"] == 10) & (ptae["seed"] == 0)]["describe_accuracy"].item()
    assert mine < draws["describe_accuracy"].min()


def test_which_thirteen_clips_have_a_label_makes_a_factor_of_three(linear):
    draws = linear[(linear["share"] == 2) & (linear["variant"] == "random")]["describe_accuracy"]
    assert 2.5 < draws.max() / draws.min() < 3.5


def test_choosing_labels_helps_no_weighted_sum_and_doubling_them_does(linear):
    score = linear.groupby(["variant", "share"])["describe_accuracy"].agg(["mean", "std"])
    for share in (1, 2, 5, 10):
        random = score.loc["random", share]
        assert score.loc["covering", share]["mean"] < random["mean"] + random["std"] / 2
    assert score.loc["random", 2]["mean"] > 1.8 * score.loc["covering", 1]["mean"]
    assert score.loc["random", 5]["mean"] > 1.8 * score.loc["covering", 2]["mean"]


def test_the_colour_is_lost_first(ptae, linear):
    random = linear[linear["variant"] == "random"]
    for rows in (ptae, random):
        words = rows.groupby("share")[WORDS].mean().loc[[2, 5, 10, 20, 50]]
        others = words[["action_accuracy", "speed_accuracy"]].min(axis=1)
        assert (words["colour_accuracy"] < others).all()


def test_presentations_are_the_same_at_every_share_of_the_balanced_variant(table):
    shown = table[(table["model"] == "ptae") & (table["variant"] == "balanced")]
    assert shown["supervised_presentations"].nunique() == 1
    assert shown.loc[shown["share"] == 50, "describe_accuracy"].iloc[0] == pytest.approx(98, abs=1)
    assert shown.loc[shown["share"] == 1, "describe_accuracy"].iloc[0] == pytest.approx(6, abs=1)


def test_sentences_are_stored_for_every_training(table):
    key = ["model", "mode", "variant", "share", "seed"]
    said = pd.read_csv(artefacts.stored("results/supervision_sentences.csv"))
    said = said[said["data"] == "recording"]
    nets = table[table["model"] != "linear"]
    assert set(said[key].itertuples(index=False)) == set(nets[key].itertuples(index=False))
    assert (said.groupby(key).size() == 6).all()
