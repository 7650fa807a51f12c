"""What chapter 02 and its page in depth say about the encoders, held against the stored tables."""

import numpy as np
import pandas as pd
import pytest

from ptae_lite import artefacts
from ptae_lite.baselines import references
from ptae_lite.data.samples import load_samples
from ptae_lite.data.scaling import fit_scaling
from ptae_lite.experiments import encoder_scores, encoders, encoders_in_use, encoders_table

UP = ["first_both", "last_both", "first_both_products", "last_both_products", "last_act",
      "joints_r2"]  # fmt: skip
DOWN = ["first_place_mm", "pixel_error"]
END = "last_place_mm"  # the less, the better, too
SEPARATED, PLAIN_10, PLAIN_30 = encoders.CAES
LONGEST = {name: max(further) for name, further in encoders.LONG.items()}


@pytest.fixture(scope="module")
def rows():
    return pd.read_csv(artefacts.stored("results/encoders.csv"))


@pytest.fixture(scope="module")
def means(rows):
    """Test scores by eye and presentations, mean over the seeds."""
    numbers = rows[rows["split"] == "test"].drop(columns=["split", "seed", "device"])
    return numbers.groupby(["encoder", "samples_seen"]).mean()


@pytest.fixture(scope="module")
def equal(rows):
    """For each comparison, the means of the three CAEs."""
    return {
        name: encoders_table.at(rows, lengths)
        .drop(columns=["split", "device"])
        .groupby("encoder")
        .mean()
        for name, lengths in encoders_table.EQUAL.items()
    }


def lead(table, columns, first, second):
    """In which of the columns an eye is ahead of another."""
    ahead = table.loc[first] > table.loc[second]
    return {c for c in columns if (ahead[c] if c in UP else not ahead[c])}


def test_every_eye_was_looked_at_untrained_and_at_the_equal_lengths(rows, means):
    for name in encoders.CAES:
        assert 0 in means.loc[name].index
    assert set(rows[rows["encoder"].isin(encoders.PCAS)]["encoder"]) == set(encoders.PCAS)
    assert rows[encoders.KEY].duplicated().sum() == 0


def test_equal_compute_was_equal(rows):
    spent = encoders_table.at(rows, encoders_table.EQUAL["compute"])["gflop"]
    assert spent.max() == pytest.approx(spent.min(), rel=1e-3)


def test_training_improves_the_drawing_but_not_always_the_reading_of_colours(means):
    for name in encoders.CAES:
        assert (np.diff(means.loc[name].sort_index()["pixel_error"]) < 0).all()
    lost = means.loc[PLAIN_30, 0]["first_both"] - means.loc[PLAIN_30, 166_960]["first_both"]
    assert 25 < lost < 26.5  # a quarter of the pairs
    assert means.loc[PLAIN_30, LONGEST[PLAIN_30]]["first_both"] > 90
    at_end = means.loc[PLAIN_30].sort_index()["last_both"]
    assert 0 < list(at_end.index).index(at_end.idxmin()) < len(at_end) - 1
    ten = means.loc[PLAIN_10].sort_index()["first_both"]
    assert (np.diff(ten[ten.index >= 166_960]) < -4).all()


def test_at_equal_arithmetic_the_plain_eye_of_30_places_and_draws_better(means):
    for n in (64_000, 128_000, 256_000, 512_000, 1_024_000):
        plain, own = means.loc[PLAIN_30], means.loc[SEPARATED, n]
        equal = plain[np.isclose(plain["gflop"], own["gflop"], rtol=1e-3)]
        assert len(equal) == 1 and (equal[DOWN] < own[DOWN]).all(axis=None)


def test_the_figures_show_what_their_descriptions_say(means):
    def path(name, column):
        return means.loc[name, column].sort_index()

    first, last = (path(SEPARATED, column) for column in UP[:2])
    assert (
        first.iloc[0] < first.iloc[-1] and first.iloc[-1] > 99 and last.iloc[-1] < last.max() - 10
    )
    first, last = (path(PLAIN_30, column) for column in UP[:2])
    assert first.min() < first.iloc[0] - 20 and first.iloc[-1] > 90
    assert last.min() < last.iloc[0] - 10 and last.iloc[-1] > last.min() + 20
    assert path(PLAIN_10, "last_both").max() < 20
    places = [path(name, DOWN[0]).iloc[-1] for name in (PLAIN_30, SEPARATED, PLAIN_10)]
    assert places == sorted(places)


def test_the_separated_eye_keeps_the_colours_of_first_frames(means):
    own = means.loc[SEPARATED].sort_index()
    assert own["first_both"].min() > 90
    trained = own[own.index > 0]["last_both"]
    assert trained.idxmax() == trained.index[0]


def test_at_equal_presentations_the_separated_eye_leads_in_every_column(equal):
    for other in (PLAIN_10, PLAIN_30):
        ahead = lead(equal["images seen"], [*UP, *DOWN, END], SEPARATED, other)
        assert ahead == {*UP, *DOWN, END}


def test_at_equal_compute_each_of_two_eyes_of_30_numbers_leads_in_something(equal):
    assert lead(equal["compute"], [*UP, *DOWN, END], SEPARATED, PLAIN_30) == {*UP, END}


def test_no_eye_reads_the_act_off_first_frames_nor_reaches_chance(means):
    assert (means["first_act"] < 100 / 6).all()


def test_products_find_colours_that_a_sum_does_not_most_of_all_at_first(means):
    for name in (PLAIN_10, PLAIN_30):
        for samples_seen in (64_000, 166_960):
            own = means.loc[name, samples_seen]
            gain = own["first_both_products"] - own["first_both"]
            assert gain > 15
            missing = [100 - own[f"{at}_both_products"] for at in ("first", "last")]
            assert missing[1] > 2 * missing[0]


def test_at_the_end_products_leave_the_lead_at_equal_compute_and_a_third_of_it_at_last(
    means, equal
):
    for found, low, high in (
        (equal["compute"], 0.9, 1),
        (means.groupby("encoder").last(), 0.28, 0.38),
    ):
        ahead = (found.loc[SEPARATED] - found.loc[PLAIN_30])[["last_both", "last_both_products"]]
        assert low < ahead.iloc[1] / ahead.iloc[0] < high


def test_what_has_levelled_off_is_what_the_page_says(rows):
    """When this fails, the page's paragraphs about the rule have to be written anew."""
    by_rule = encoders_table.converged(rows)
    assert by_rule[by_rule].index.tolist() == [(SEPARATED, 512_000)]
    changed = encoders_table.changes(rows)
    after = changed.loc[SEPARATED, 1_024_000]
    assert round(after["first_place_mm"]) == -11 and round(after["last_both"]) == -4
    drawing = {name: changed.loc[name, "pixel_error"] for name in encoders.CAES}
    for own in drawing.values():
        assert own.is_monotonic_increasing and -7.5 < own.iloc[-1] < -5
        assert -30.5 < own.iloc[0] < -15.5
    eight_times = {name: 8 * length for name, length in encoders.EQUAL_COMPUTE.items()}
    assert all(drawing[name][n] > -10 for name, n in eight_times.items())
    colours = {name: changed.loc[name, "first_both"] for name in encoders.CAES}
    assert (colours[SEPARATED].abs() < 3).all() and (colours[PLAIN_30].iloc[-2:].abs() < 3).all()
    assert colours[PLAIN_30].abs()[667_840] > 3 and colours[PLAIN_10].iloc[-1] < -10
    gained = changed.loc[PLAIN_30, "last_both"].iloc[-3:]
    assert (round(gained.min()), round(gained.max())) == (7, 15)
    places = [changed.loc[name, "first_place_mm"].iloc[-1] for name in (SEPARATED, PLAIN_30)]
    assert [round(place) for place in places] == [-11, -20]


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


def test_the_verdict_rests_on_three_seeds_whose_ranges_of_colours_do_not_touch(rows):
    for lengths in encoders_table.EQUAL.values():
        same = encoders_table.at(rows, lengths)
        assert set(same.groupby("encoder")["seed"].nunique()) == {3}
        for column in ("first_both", "last_both", "last_both_products"):
            apart = same[same["encoder"] == SEPARATED][column]
            assert apart.min() > same[same["encoder"] != SEPARATED][column].max()


def overlap(table, column, first, second):
    """Whether the ranges over the seeds of two eyes share a value."""
    one, two = (table[table["encoder"] == name][column] for name in (first, second))
    return one.min() <= two.max() and two.min() <= one.max()


def test_where_the_ranges_overlap_is_where_the_verdict_says_so(rows):
    seen, compute = (encoders_table.at(rows, lengths) for lengths in encoders_table.EQUAL.values())
    for column, both in (("first_place_mm", True), ("last_act", True),
                         ("first_both", False), ("last_both", False)):  # fmt: skip
        assert overlap(seen, column, SEPARATED, PLAIN_30) == both
    assert not overlap(compute, "first_place_mm", SEPARATED, PLAIN_30)
    for column in ("last_act", END, "pixel_error"):
        assert overlap(compute, column, SEPARATED, PLAIN_30)


@pytest.fixture(scope="module")
def longest(rows):
    """Test scores of the greatest lengths, by eye and seed."""
    return encoders_table.at(rows, LONGEST).set_index(["encoder", "seed"])


def test_the_greatest_lengths_have_three_seeds_each(rows, longest):
    assert longest.groupby("encoder").size().to_dict() == {
        SEPARATED: 3, PLAIN_10: 4, PLAIN_30: 3
    }  # fmt: skip
    assert set(longest.drop(PLAIN_10)["device"]) == {"cuda"}
    equal = encoders_table.at(rows, encoders_table.EQUAL["compute"])["gflop"].mean()
    times = (longest["gflop"] / equal).groupby("encoder").mean().round(1)
    assert times.to_dict() == {SEPARATED: 16, PLAIN_10: 8, PLAIN_30: 16}


def test_plain_eyes_trained_on_a_cpu_show_the_fewest_colours_or_the_most(rows):
    test = (
        rows[rows["split"] == "test"].set_index(["encoder", "samples_seen", "device"]).sort_index()
    )

    def shown(encoder, samples_seen, column="first_both"):
        return (test.loc[[(encoder, samples_seen, on)], column] for on in ("cpu", "cuda"))

    cpu, gpu = shown(PLAIN_30, 667_840)
    assert (len(cpu), len(gpu)) == (2, 5)
    assert cpu.max() < gpu.min()
    cpu, gpu = shown(PLAIN_30, 1_335_680)
    assert len(cpu) == 1 and len(gpu) == 3
    assert cpu.item() < gpu.min()
    cpu, gpu = shown(PLAIN_30, 1_335_680, "last_both")
    assert cpu.item() < gpu.min()
    for better in DOWN:
        cpu, gpu = shown(PLAIN_30, 1_335_680, better)
        assert cpu.item() < gpu.min()
    cpu, gpu = shown(PLAIN_10, 667_840)
    assert cpu.min() > gpu.max()
    cpu, gpu = shown(PLAIN_10, 1_335_680)
    assert cpu.item() > gpu.max()
    for what in ("four times as long", "eight times as long"):
        for encoder, samples_seen in encoders.IN_USE[what].items():
            cpu, gpu = shown(encoder, samples_seen)
            assert len(cpu) in (1, 2) and len(gpu) > len(cpu)


def test_trained_longest_the_plain_eye_of_30_shows_most_colours_of_first_frames(longest, means):
    first, last = longest["first_both"], longest["last_both"]
    assert (round(first[PLAIN_30].min()), round(first[PLAIN_30].max())) == (86, 97)
    assert first[SEPARATED].min() > 99 and last[SEPARATED].min() > last[PLAIN_30].max()
    assert (round(last[SEPARATED].mean()), round(last[PLAIN_30].mean())) == (67, 47)
    assert (round(first[PLAIN_10].mean()), round(last[PLAIN_10].mean())) == (41, 19)
    short, long = means.loc[SEPARATED, 32_000], means.loc[PLAIN_30, 667_840]
    assert 7.9 < long["gflop"] / short["gflop"] < 8.1
    assert 85 < long["first_both"] < short["first_both"]


def test_no_plain_training_shows_as_many_colours_as_the_worst_separated_one(rows):
    trained = rows[(rows["samples_seen"] > 0) & (rows["split"] == "test")]
    colours = trained.groupby("encoder")["first_both"]
    assert colours.max()[[PLAIN_10, PLAIN_30]].max() < colours.min()[SEPARATED]


def test_against_ten_plain_numbers_the_lead_grows_with_the_length(means):
    lengths = [(64_000 * k, 166_960 * k) for k in (1, 2, 4, 8)]
    leads = [means.loc[SEPARATED, a]["first_both"] - means.loc[PLAIN_10, b]["first_both"]
             for a, b in lengths]  # fmt: skip
    assert (np.diff(leads) > 0).all()


def by_length(model):
    """A model's scores by encoder, for each length of the encoders' training, and with PCAs."""
    rows = encoders_in_use.stored()
    rows = rows[rows["model"] == model]
    found = {
        what: rows[rows["samples_seen"] == rows["encoder"].map(lengths)].set_index("encoder")
        for what, lengths in encoders.IN_USE.items()
    }
    return found | {"PCA": rows[rows["encoder"].isin(encoders.PCAS)].set_index("encoder")}


@pytest.fixture(scope="module")
def in_use():
    """With Adam alone."""
    return by_length("ptae_adam")


@pytest.fixture(scope="module")
def regular():
    """With the recipe of chapter 03, by encoder: after equal images, at equal compute, PCAs."""
    found = by_length("ptae")
    return [found[what] for what in ("equal images seen", "equal compute", "PCA")]


def test_the_regular_recipe_has_three_seeds_behind_each_encoder(regular):
    rows = encoders_in_use.stored().query("model == 'ptae'")
    assert set(rows["encoder"]) == {*encoders.CAES, *encoders.PCAS} and len(rows) == 24
    for found in regular:
        assert found.groupby("encoder")["seed"].agg(set).eq({0, 1, 2}).all()


def seed_by_seed(rows, column):
    return rows.reset_index().set_index(["encoder", "seed"])[column].unstack("encoder")


def test_ptae_describes_better_with_the_separated_encoder_than_with_plain_ones(regular, in_use):
    for rows in regular[:2]:
        words = seed_by_seed(rows, "describe_accuracy")
        assert (words[SEPARATED] == 100).all()
        assert words[[PLAIN_10, PLAIN_30]].mean().max() < 98
    images, compute = (seed_by_seed(rows, "describe_accuracy") for rows in regular[:2])
    assert (compute[[PLAIN_10, PLAIN_30]] < 100).all(axis=None)
    assert images[PLAIN_10].max() > images[PLAIN_10].min() + 30  # it depends on the seed
    gained = (compute - images).mean()
    assert gained[PLAIN_10] > 20 and -5 < gained[PLAIN_30] < 0
    for what in ("equal images seen", "equal compute"):  # with Adam alone, too
        words = in_use[what].groupby("encoder")["describe_accuracy"].mean()
        assert words.idxmax() == SEPARATED


def test_in_motion_the_large_plain_encoder_gains_on_the_separated_one(regular):
    images, compute = (seed_by_seed(rows, "execute_nrmse") for rows in regular[:2])
    assert images.idxmin(axis=1).eq(SEPARATED).all()
    assert (compute[PLAIN_30] < compute[SEPARATED]).sum() == 2
    assert (compute[PLAIN_10] > compute[SEPARATED]).all()


def test_joint_pca_serves_ptae_best(regular):
    images, compute, pcas = regular
    assert (pcas.loc["PCA 3x10", "describe_accuracy"] == 100).all()
    joint = pcas.loc["PCA 30"]
    others = pd.concat([images, compute, pcas.drop("PCA 30")])
    assert (joint["describe_accuracy"] == 100).all()
    assert joint["execute_nrmse"].max() < others["execute_nrmse"].min()


@pytest.fixture(scope="module")
def with_equal(in_use):
    return in_use["equal compute"]


def test_ptae_was_trained_three_times_with_each_eye_and_once_with_the_longest(in_use):
    for what, rows in in_use.items():
        assert set(rows.index) == set(encoders.PCAS if what == "PCA" else encoders.CAES)
        seeds = 1 if what == "eight times as long" else 3
        assert rows.groupby("encoder")["seed"].nunique().eq(seeds).all()


def test_at_equal_presentations_ptae_describes_worse_with_plain_eyes_but_moves_better(
    in_use, equal
):
    rows = in_use["equal images seen"]
    own, ten, thirty = (rows.loc[name] for name in encoders.CAES)
    words = "describe_accuracy"
    for plain in (ten, thirty):
        assert plain[words].mean() < own[words].mean() - 35
    assert thirty[words].max() > thirty[words].min() + 30  # it depends on the seed
    motion = "execute_nrmse"
    assert thirty[motion].max() < own[motion].min() and own[motion].max() < ten[motion].min()
    assert equal["images seen"]["first_place_mm"].idxmin() == SEPARATED


def test_ptae_describes_better_with_the_separated_eye(with_equal):
    own, ten, thirty = (with_equal.loc[name, "describe_accuracy"] for name in encoders.CAES)
    assert own.min() > ten.max()
    assert own.mean() > thirty.mean() + 3 and own.min() < thirty.max()  # the ranges touch


def test_ptae_moves_more_exactly_with_the_plain_eye_of_the_same_size(with_equal):
    assert (
        with_equal.loc[PLAIN_30, "execute_nrmse"].max()
        < with_equal.loc[SEPARATED, "execute_nrmse"].min()
    )


@pytest.fixture(scope="module")
def after_four(in_use):
    return in_use["four times as long"]


def test_after_four_times_words_follow_the_colours_of_the_plain_eye(after_four, with_equal, rows):
    words, motion = after_four["describe_accuracy"], after_four["execute_nrmse"]
    seen = rows[rows["split"] == "test"].merge(
        after_four.reset_index()[[*encoders_in_use.KEY[1:], "device", "describe_accuracy"]],
        validate="one_to_one",
    )
    assert len(seen) == len(after_four) == 10
    thirty = seen[seen["encoder"] == PLAIN_30].set_index("device")
    gpu, cpu = (thirty.loc[device] for device in ("cuda", "cpu"))
    assert len({*gpu["seed"]} & {*cpu["seed"]}) == 1
    assert len(gpu) == len(cpu) == 2
    assert gpu["first_both"].min() > cpu["first_both"].max() + 10
    assert gpu["describe_accuracy"].min() > words[SEPARATED].min()
    assert cpu["describe_accuracy"].max() < words[SEPARATED].min()
    assert words[PLAIN_30].mean() > with_equal.loc[PLAIN_30, "describe_accuracy"].mean() + 3
    assert words[PLAIN_10].max() < words[SEPARATED].min() - 5
    assert motion[PLAIN_30].max() < motion[SEPARATED].min()
    assert motion[PLAIN_10].max() < with_equal.loc[PLAIN_10, "execute_nrmse"].min()


def test_a_longer_training_helps_in_motion(after_four, with_equal):
    errors = [rows.groupby("encoder")["execute_nrmse"].mean() for rows in (after_four, with_equal)]
    assert (errors[0] < errors[1]).all()


def test_after_eight_times_nothing_turns_round(in_use):
    rows = in_use["eight times as long"]
    words, motion = rows["describe_accuracy"], rows["execute_nrmse"]
    assert abs(words[SEPARATED] - words[PLAIN_30]) < 3
    assert words[PLAIN_10] < words[PLAIN_30] - 5 and motion[PLAIN_30] < motion[SEPARATED] - 0.2
    for before in ("equal compute", "four times as long"):
        own = in_use[before].loc[SEPARATED].set_index("seed")["describe_accuracy"]
        assert set(rows["seed"]) == {own.idxmin()}


def test_joint_pca_serves_ptae_as_well(in_use, with_equal):
    joint, own = in_use["PCA"].loc["PCA 30"], with_equal.loc[SEPARATED]
    assert joint["describe_accuracy"].median() >= own["describe_accuracy"].median()
    assert joint["execute_nrmse"].max() < own["execute_nrmse"].min()


def test_ptae_moves_better_than_a_plan_with_every_encoder_and_with_adam_but_one(in_use, regular):
    samples = load_samples()
    scaling = fit_scaling(samples, samples.split("train"))
    known = {name: error for name, (error, _) in references(samples, scaling).items()}
    plan = known["plan from the true places"]
    assert round(plan, 1) == 1.9
    assert max(rows["execute_nrmse"].max() for rows in regular) < plan
    errors = pd.concat(in_use.values())["execute_nrmse"]
    assert (errors.drop("PCA 10") < plan).all() and plan < errors["PCA 10"].min()


def test_drawings_are_stored_of_every_eye():
    with np.load(artefacts.stored("results/encoder_reconstructions.npz")) as file:
        assert set(file.files) == {*encoders.CAES, *encoders.PCAS}
        assert {file[name].shape for name in file.files} == {
            (len(encoder_scores.DRAWN), 120, 160, 3)
        }
