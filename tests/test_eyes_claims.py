"""What chapter 02 says about the eyes, held against the stored tables."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from ptae_lite import artefacts, dataset
from ptae_lite.evaluation import references
from ptae_lite.scaling import fit_scaling
from ptae_lite.studies import eye_scores, eyes, eyes_ptae, eyes_table

CHAPTER = Path(__file__).resolve().parents[1] / "book" / "02_vision.md"
UP = ["first_both", "last_both", "first_both_products", "last_both_products", "last_act",
      "joints_r2"]  # fmt: skip
DOWN = ["first_place_mm", "pixel_error"]
END = "last_place_mm"  # the less, the better, too
SEPARATED, PLAIN_10, PLAIN_30 = eyes.CAES
LONGEST = {name: max(further) for name, further in eyes.LONG.items()}


@pytest.fixture(scope="module")
def rows():
    return pd.read_csv(artefacts.stored("results/eyes.csv"))


@pytest.fixture(scope="module")
def text():
    return " ".join(CHAPTER.read_text(encoding="utf-8").split())


@pytest.fixture(scope="module")
def means(rows):
    """Test scores by eye and presentations, mean over the seeds."""
    numbers = rows[rows["split"] == "test"].drop(columns=["split", "seed", "device"])
    return numbers.groupby(["eye", "presentations"]).mean()


@pytest.fixture(scope="module")
def equal(rows):
    """For each comparison, the means of the three CAEs."""
    return {
        name: eyes_table.at(rows, lengths).drop(columns=["split", "device"]).groupby("eye").mean()
        for name, lengths in eyes_table.EQUAL.items()
    }


def lead(table, columns, first, second):
    """In which of the columns an eye is ahead of another."""
    ahead = table.loc[first] > table.loc[second]
    return {c for c in columns if (ahead[c] if c in UP else not ahead[c])}


def test_every_eye_was_looked_at_untrained_and_at_the_equal_lengths(rows, means):
    for name in eyes.CAES:
        assert 0 in means.loc[name].index
    assert set(rows[rows["eye"].isin(eyes.PCAS)]["eye"]) == set(eyes.PCAS)
    assert rows[eyes.KEY].duplicated().sum() == 0


def test_equal_compute_was_equal(rows):
    spent = eyes_table.at(rows, eyes_table.EQUAL["compute"])["gflop"]
    assert spent.max() == pytest.approx(spent.min(), rel=1e-3)


def test_training_a_plain_eye_improves_its_drawing_but_hardly_the_reading_of_colours(means):
    for name in (PLAIN_10, PLAIN_30):
        own = means.loc[name].sort_index()
        assert (np.diff(own["pixel_error"]) < 0).all()
        colours = own["first_both"]
        assert colours[64_000] < colours[0] and colours[166_960] < colours[0] + 5
        assert colours[333_920] < colours[0]


def test_the_separated_eye_keeps_the_colours_of_first_frames(means):
    own = means.loc[SEPARATED].sort_index()
    assert own["first_both"].min() > 90
    trained = own[own.index > 0]["last_both"]
    assert trained.idxmax() == trained.index[0]


def test_at_equal_presentations_the_separated_eye_leads_in_every_column(equal):
    for other in (PLAIN_10, PLAIN_30):
        ahead = lead(equal["presentations"], [*UP, *DOWN, END], SEPARATED, other)
        assert ahead == {*UP, *DOWN, END}


def test_at_equal_compute_each_of_two_eyes_of_30_numbers_leads_in_something(equal):
    assert lead(equal["compute"], [*UP, *DOWN, END], SEPARATED, PLAIN_30) == {*UP, END}


def test_no_eye_reads_the_act_off_first_frames_nor_reaches_chance(means):
    assert (means["first_act"] < 100 / 6).all()


def test_products_find_colours_that_a_sum_does_not_most_of_all_at_first(means):
    for name in (PLAIN_10, PLAIN_30):
        for presentations in (64_000, 166_960):
            own = means.loc[name, presentations]
            gain = own["first_both_products"] - own["first_both"]
            assert gain > 15
            missing = [100 - own[f"{at}_both_products"] for at in ("first", "last")]
            assert missing[1] > 2 * missing[0]


def test_nothing_has_levelled_off_yet(rows, text):
    """When this fails, the page's paragraph about the rule has to be written anew."""
    assert ("By this rule nothing has levelled off yet" in text) == (
        not eyes_table.levelled(rows).any()
    )


def test_eyes_that_were_never_trained_read_colours(means):
    assert means.loc[SEPARATED, 0]["first_both"] > 90
    assert means.loc[PLAIN_30, 0]["first_both"] > 85
    assert means.loc["PCA 30"]["first_both"].item() > 99
    assert means.loc["PCA 10"]["first_both"].item() > 99


def test_the_two_pcas_of_30_numbers_are_ordered_as_the_caes_at_equal_compute(means, equal):
    apart, joint = (means.loc[name].iloc[0] for name in ("PCA 3x10", "PCA 30"))
    assert apart["last_both"] > joint["last_both"]
    assert apart["first_place_mm"] > joint["first_place_mm"]
    assert apart["pixel_error"] > joint["pixel_error"]
    caes = equal["compute"]
    assert caes.loc[SEPARATED, "last_both"] > caes.loc[PLAIN_30, "last_both"]
    assert caes.loc[SEPARATED, "first_place_mm"] > caes.loc[PLAIN_30, "first_place_mm"]
    assert caes.loc[SEPARATED, "pixel_error"] > caes.loc[PLAIN_30, "pixel_error"]


def test_wrong_colours_in_drawings_are_of_short_trainings(means):
    for name in (PLAIN_10, PLAIN_30):
        own = means.loc[name]["colour_pixel_error"]
        assert own[166_960] < 0.7 * own[64_000]


def test_the_verdict_rests_on_three_seeds_whose_ranges_of_colours_do_not_touch(rows, text):
    assert "Three seeds of each eye, and their ranges do not touch" in text
    for lengths in eyes_table.EQUAL.values():
        same = eyes_table.at(rows, lengths)
        assert set(same.groupby("eye")["seed"].nunique()) == {3}
        for column in ("first_both", "last_both", "last_both_products"):
            apart = same[same["eye"] == SEPARATED][column]
            assert apart.min() > same[same["eye"] != SEPARATED][column].max()


@pytest.fixture(scope="module")
def longest(rows):
    """Test scores of the greatest lengths, by eye and seed."""
    return eyes_table.at(rows, LONGEST).set_index(["eye", "seed"])


def test_the_greatest_lengths_cost_four_times_equal_compute(rows, longest):
    assert longest.groupby("eye").size().to_dict() == {SEPARATED: 2, PLAIN_10: 2, PLAIN_30: 3}
    on_cpu = longest[longest["device"] == "cpu"]
    assert on_cpu.index.tolist() == [(PLAIN_30, 0)]
    assert set(rows[~rows["presentations"].isin(longest["presentations"])]["device"]) == {"cpu"}
    equal = eyes_table.at(rows, eyes_table.EQUAL["compute"])["gflop"].mean()
    assert (longest["gflop"] / equal).between(3.99, 4.01).all()


def test_trained_longest_the_plain_eye_of_30_shows_most_colours_of_first_frames(longest, means):
    first, last = longest["first_both"], longest["last_both"]
    assert (round(first[PLAIN_30].min()), round(first[PLAIN_30].max())) == (79, 98)
    assert round(first[SEPARATED].min(), 1) == 99.5 and first[PLAIN_10].max() < 50
    assert (round(last[PLAIN_30].min()), round(last[PLAIN_30].max())) == (11, 57)
    assert last[SEPARATED].min() > last[PLAIN_30].max()
    assert (round(last[SEPARATED].mean()), round(last[PLAIN_30].mean())) == (69, 39)
    short = means.loc[SEPARATED, 32_000]
    assert short["first_both"] > first[PLAIN_30].max()
    assert 7.9 < longest.loc[PLAIN_30, "gflop"].mean() / short["gflop"] < 8.1


def test_in_the_separated_eye_the_colours_rest_and_in_the_plain_one_of_30_they_move_most(rows):
    changed = eyes_table.changes(rows)
    for name in eyes.CAES:
        drawing = changed.loc[name, "pixel_error"]
        assert drawing.is_monotonic_increasing and (drawing < -10).all()
    colours = [*eyes_table.COLOURS]
    assert (changed.loc[SEPARATED, colours].iloc[-1].abs() < 3).all()
    assert (changed.loc[SEPARATED, "first_both"].abs() < 3).all()
    moved = changed.loc[PLAIN_30, colours]
    assert (
        moved.iloc[-1].round(1).tolist() == [25.3, 13.5] and (moved.abs().idxmax() == 667_840).all()
    )


@pytest.fixture(scope="module")
def in_use():
    """PTAE's scores by eye, of equal compute: a column a measure, a row a seed."""
    rows = eyes_ptae.stored()
    return rows[~rows["presentations"].isin(LONGEST.values())].set_index("eye")


def test_ptae_was_trained_three_times_with_each_eye(in_use):
    assert set(in_use.index) == {*eyes.CAES, *eyes.PCAS}
    assert in_use.groupby("eye")["seed"].nunique().eq(3).all()
    for name, presentations in eyes.EQUAL_COMPUTE.items():
        assert (in_use.loc[name, "presentations"] == presentations).all()


def test_ptae_describes_better_with_the_separated_eye(in_use):
    own, ten, thirty = (in_use.loc[name, "describe_accuracy"] for name in eyes.CAES)
    assert own.min() > ten.max()
    assert own.mean() > thirty.mean() + 3 and own.min() < thirty.max()  # the ranges touch


def test_ptae_moves_more_exactly_with_the_plain_eye_of_the_same_size(in_use):
    assert (
        in_use.loc[PLAIN_30, "execute_nrmse"].max() < in_use.loc[SEPARATED, "execute_nrmse"].min()
    )


def test_trained_longest_the_plain_eye_of_30_serves_ptae_nearly_as_well_in_words(in_use, longest):
    rows = eyes_ptae.stored()
    own = rows[rows["presentations"] == rows["eye"].map(LONGEST)].set_index("eye")
    same = ["eye", "seed", "device"]
    found, wanted = (set(own.reset_index()[same].itertuples(index=False, name=None))
                     for own in (own, longest))  # fmt: skip
    assert len(own) == 7 and found == wanted
    words, motion = own["describe_accuracy"], own["execute_nrmse"]
    assert abs(words[PLAIN_30].mean() - words[SEPARATED].mean()) < 2
    assert words[PLAIN_30].mean() > in_use.loc[PLAIN_30, "describe_accuracy"].mean() + 5
    least = longest.loc[PLAIN_30].sort_values("last_both").iloc[0]
    lowest = own.loc[PLAIN_30].sort_values("describe_accuracy").iloc[0]
    assert least["device"] == lowest["device"] == "cpu"
    assert round(lowest["describe_accuracy"], 1) == 92.6
    assert motion[PLAIN_30].max() < motion[SEPARATED].min()
    assert words[PLAIN_10].max() < words[SEPARATED].min() - 5
    assert motion[PLAIN_10].max() < in_use.loc[PLAIN_10, "execute_nrmse"].min()


def test_joint_pca_serves_ptae_as_well(in_use):
    joint, own = in_use.loc["PCA 30"], in_use.loc[SEPARATED]
    assert joint["describe_accuracy"].median() >= own["describe_accuracy"].median()
    assert joint["execute_nrmse"].max() < own["execute_nrmse"].min()


def test_ptae_moves_better_than_a_plan_with_every_eye_but_one(in_use):
    samples = dataset.load()
    scaling = fit_scaling(samples, samples.split("train"))
    known = {name: error for name, (error, _) in references(samples, scaling).items()}
    plan = known["plan from the true places"]
    assert round(plan, 1) == 1.9 and round(known["mean of action word and side"], 1) == 2.8
    assert (in_use.drop("PCA 10")["execute_nrmse"] < plan).all()
    assert plan < in_use.loc["PCA 10", "execute_nrmse"].min()


def test_drawings_are_stored_of_every_eye():
    with np.load(artefacts.stored("results/eyes_drawings.npz")) as file:
        assert set(file.files) == {*eyes.CAES, *eyes.PCAS}
        assert {file[name].shape for name in file.files} == {(len(eye_scores.DRAWN), 120, 160, 3)}
