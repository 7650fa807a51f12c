"""What chapter 03 says of the family, held against the stored tables."""

import numpy as np
import pandas as pd
import pytest
import torch

from ptae_lite import artefacts, controls, evaluation
from ptae_lite.baselines import references
from ptae_lite.data.frames import video_patterns
from ptae_lite.data.samples import load_samples
from ptae_lite.data.scaling import fit_scaling
from ptae_lite.data.signals import build, signal_number
from ptae_lite.experiments import family, incongruence
from ptae_lite.language import VOCABULARY, patterns, sentence
from ptae_lite.paper import reported
from ptae_lite.paper.claim_metrics import MARGIN

MODELS_OF_PAPER = ("PTAE", "PGAE", "PVAE")
ELDERS = ("PRAE", "PGAE", "PVAE")
SWAPPED = "execute_speed_word_swapped"


@pytest.fixture(scope="module")
def rows():
    table = pd.read_csv(artefacts.stored("results/family.csv"))
    return table[table["data"] == "recording"]


@pytest.fixture(scope="module")
def medians(rows):
    return rows.groupby("variant").median(numeric_only=True)


def test_every_variant_was_trained_three_times_and_the_regular_models_five_times(rows):
    assert set(rows["variant"]) == set(family.VARIANTS)
    for name in family.VARIANTS:
        seeds = 5 if name in MODELS_OF_PAPER else 3
        assert set(rows[rows["variant"] == name]["seed"]) == set(range(seeds))


def test_pvae_is_ahead_of_ptae_and_ptae_of_pgae(rows):
    for better, worse in (("PVAE", "PTAE"), ("PTAE", "PGAE")):
        for column in ("execute_nrmse", "repeat_action_nrmse"):
            assert family.clearly_better(rows, better, worse, column) == better
        assert family.clearly_better(rows, better, worse, "describe_accuracy") == better
    assert (rows[rows["variant"] == "PVAE"]["describe_accuracy"] == 100).all()


def test_pgae_describes_less_well_than_the_others_and_two_depend_on_the_seed(rows, medians):
    own = rows.groupby("variant")["describe_accuracy"]
    for other in ("PTAE", "PVAE", "PRAE"):
        assert medians.loc["PGAE", "describe_accuracy"] < own.min()[other]
    assert (own.max() - own.min())[["PTAE", "PRAE"]].between(1, 8).all()
    assert medians.loc["PVAE", "parameters"] / medians.loc["PTAE", "parameters"] < 0.34


def test_what_is_described_wrongly_is_most_of_all_what_has_no_twin(rows):
    wrong = {part: 100 - rows.set_index("variant")[f"describe_accuracy_{part}_scenes"]
             for part in ("known", "new")}  # fmt: skip
    one_of_144 = 100 / 144
    assert wrong["known"]["PTAE"].round(1).tolist() == [0, round(one_of_144, 1), 0]
    assert (wrong["new"]["PTAE"] > 0).all()
    assert (wrong["new"]["PGAE"] >= 25).all() and (wrong["known"]["PGAE"] < 14).all()
    assert (wrong["new"]["PGAE"] > 2 * wrong["known"]["PGAE"]).all()
    assert not wrong["new"]["PVAE"].any() and not wrong["known"]["PVAE"].any()


def test_the_published_pgae_has_500_times_as_many_updates():
    table = pd.read_csv(artefacts.stored("results/family.csv"))
    theirs = table[(table["data"] != "recording") & (table["variant"] == "PGAE")]
    assert 500 < reported.STEPS["pgae"] / theirs["steps"].max() < 600


def test_what_is_taken_away_costs_what_the_page_says(rows):
    """Of the model of seed 0, which the page asks."""
    own = rows[(rows["variant"] == "PTAE") & (rows["seed"] == 0)].iloc[0]
    assert 2.6 < own["execute_sentence_blanked"] / own["execute_nrmse"] < 3
    assert own["execute_video_frozen"] > 1.3 * 10.8  # the mean trajectory's


def test_ptae_does_not_hear_the_speed_word_and_the_elders_do(rows):
    ratio = rows[SWAPPED] / rows["execute_nrmse"]
    assert ratio[rows["variant"] == "PTAE"].between(0.95, 1.05).all()
    assert ratio[rows["variant"].isin(ELDERS)].between(2.5, 5).all()


def test_with_the_first_frame_only_the_sentence_makes_the_motion(medians):
    first, video = medians.loc["PTAE, frozen video"], medians.loc["PTAE"]
    assert 2 < first["execute_nrmse"] / video["execute_nrmse"] < 3
    assert first["execute_sentence_blanked"] > 10.8  # the mean trajectory's
    assert first[SWAPPED] < 1.1 * first["execute_nrmse"]


def test_the_first_frames_error_depends_on_the_seed(rows):
    errors = rows[rows["variant"] == "PTAE, frozen video"]["execute_nrmse"]
    assert errors.max() / errors.min() > 1.5 and 2.8 < errors.min() < 3.5


def test_repeat_both_helps_pgae_a_little_and_no_choice_helps_ptae(rows):
    judged = family.claims(rows).set_index("claim")
    helps = judged.loc["repeat both helps PGAE"]
    assert (helps["describe_accuracy"], helps["execute_nrmse"]) == ("neither", "PGAE")
    pair = ("PGAE, no repeat both", "PGAE")
    errors = rows.groupby("variant")["execute_nrmse"].median()[list(pair)]
    assert 1 < errors.iloc[0] / errors.iloc[1] < 1.1
    several = judged.drop("repeat both helps PGAE")
    assert (several[["describe_accuracy", "execute_nrmse"]] == "neither").all(axis=None)
    choice = family.clearly_better(rows, "PTAE", "PTAE, no mixup", "describe_accuracy")
    assert choice == "neither"


def test_frames_that_ask_repeat_less_and_hear_the_speed_word_in_two_seeds(rows):
    asks = rows[rows["variant"] == "PTAE, action as query"]
    regular = rows[rows["variant"] == "PTAE"]
    assert (asks["repeat_language_accuracy"] < 99).sum() == 2
    assert (regular["repeat_language_accuracy"] == 100).all()
    assert (asks[SWAPPED] > 2 * asks["execute_nrmse"]).sum() == 2
    assert asks["seconds"].median() > 2 * regular["seconds"].median()


def test_the_clock_keeps_the_speed(rows):
    for column in ("describe_accuracy", "execute_nrmse"):
        assert family.clearly_better(rows, "PTAE", "PTAE, frame positions", column) == "neither"


def test_ptae_needs_as_many_updates_as_pgae_but_three_fifths_of_the_time():
    curves = pd.read_csv(artefacts.stored("results/family_curves.csv"))
    curves = curves[(curves["data"] == "recording") & curves["variant"].isin(["PTAE", "PGAE"])]
    reached = family.updates_to(curves, 75).groupby("variant").median(numeric_only=True)
    assert 0.8 < reached.loc["PTAE", "updates"] / reached.loc["PGAE", "updates"] < 1.2
    assert 0.5 < reached.loc["PTAE", "seconds"] / reached.loc["PGAE", "seconds"] < 0.7
    early = family.updates_to(curves, 50).pivot(index="seed", columns="variant", values="updates")
    assert (early["PGAE"] < early["PTAE"]).sum() == 2


@pytest.mark.parametrize("long", ["PTAE, long", "PGAE, long"])
def test_a_long_training_has_eight_times_the_updates_and_takes_half_an_hour(rows, long):
    some = rows[rows["variant"] == long]
    regular = rows[rows["variant"] == long.removesuffix(", long")]
    assert set(some["seed"]) == {0, 1, 2}
    assert set(some["steps"]) == {8 * regular["steps"].iloc[0]}
    assert some["seconds"].between(20 * 60, 40 * 60).all()
    times = {"PTAE, long": 140, "PGAE, long": 450}[long]  # the published training has, of ours
    steps = reported.STEPS[regular["model"].iloc[0]]
    assert steps / regular["steps"].iloc[0] == pytest.approx(times, rel=0.01)


def test_after_eight_times_the_updates_pgae_is_nearly_level_with_ptae(rows, medians):
    long = ("PTAE, long", "PGAE, long")
    for column in ("describe_accuracy", "execute_nrmse"):
        assert family.clearly_better(rows, *long, column) == "neither"
    assert family.clearly_better(rows, *long, "repeat_action_nrmse") == "PTAE, long"
    ptae, pgae = medians.loc[list(long), "execute_nrmse"]
    assert ptae < pgae < 1.1 * ptae
    for name in long:
        regular = name.removesuffix(", long")
        for column in ("execute_nrmse", "repeat_action_nrmse"):
            assert family.clearly_better(rows, name, regular, column) == name
        some, before = rows[rows["variant"] == name], rows[rows["variant"] == regular]
        assert (some["describe_accuracy"] > 98.5).all()
        assert round(some["execute_nrmse"].median(), 1) == 1.2
        assert some["execute_video_frozen"].min() > before["execute_video_frozen"].max()
    ptae = rows[rows["variant"] == "PTAE, long"]
    assert set((216 * (1 - ptae["describe_accuracy"] / 100)).round()) == {0, 1}
    assert (ptae[SWAPPED] > 1.5 * ptae["execute_nrmse"]).sum() == 2


def test_the_length_is_most_of_the_distance_to_the_papers_errors(medians):
    """As the report card says of both rows, and the course of the first."""
    for column in ("execute_nrmse", "repeat_action_nrmse"):
        paper = reported.REGULAR[column].value
        short, long = medians.loc[["PTAE", "PTAE, long"], column]
        assert round(long, 1) == 1.2 and long < paper + MARGIN["% NRMSE"]
        assert (short - long) / (short - paper) == pytest.approx(3 / 4, abs=0.06)


def test_everything_is_described_right_soon_on_the_authors_data_and_not_on_ours():
    curves = pd.read_csv(artefacts.stored("results/family_curves.csv"))
    reached = {
        data: family.updates_to(curve, 100)
        for data, curve in curves[curves["variant"] == "PTAE"].groupby("data")
    }
    theirs = reached["authors, 18 held out"]
    assert sorted(theirs["updates"]) == [700, 800, 800]
    assert theirs["seconds"].between(60, 100).all()
    assert reached["recording"]["updates"].isna().all()


@pytest.mark.parametrize(("level", "seeds"), [(75, 1), (90, 3), (95, 0)])
def test_where_a_long_ptae_needs_less_than_half_of_pgaes_updates(level, seeds):
    curves = pd.read_csv(artefacts.stored("results/family_curves.csv"))
    curves = curves[curves["data"] == "recording"]
    long = curves[curves["variant"].isin(["PTAE, long", "PGAE, long"])]
    updates = family.updates_to(long, level).pivot(
        index="seed", columns="variant", values="updates"
    )
    assert (updates["PTAE, long"] / updates["PGAE, long"] < 0.5).sum() == seeds


def test_this_seed_is_a_lucky_one(rows):
    own = rows[rows["variant"] == "PTAE"].set_index("seed")["describe_accuracy"]
    assert own.idxmax() == 0


def test_on_the_authors_data_pgae_knows_scenes_by_heart():
    """Where a twin of the other speed was in training it describes worse than in a new scene."""
    table = pd.read_csv(artefacts.stored("results/family.csv"))
    theirs = table[table["data"] != "recording"].set_index("variant")
    assert set(theirs["data"]) == {"authors, 18 held out"}
    assert (theirs.loc[["PTAE", "PVAE", "PGAE"]].groupby("variant")["seed"].nunique() == 3).all()
    describe = theirs[["describe_accuracy_known_scenes", "describe_accuracy_new_scenes"]]
    assert (describe.loc[["PTAE", "PVAE"]] == 100).all(axis=None)
    known, new = (describe.loc["PGAE", column] for column in describe)
    assert (new >= 90).all() and (known < 50).all() and 23 < known.median() < 30
    errors = table.groupby(["data", "variant"])["execute_nrmse"].median()
    halves = errors["authors, 18 held out"] / errors["recording"]
    assert halves[["PTAE", "PVAE"]].between(0.45, 0.55).all()


def test_on_the_authors_data_a_long_pgae_unlearns_most_scenes():
    table = pd.read_csv(artefacts.stored("results/family.csv"))
    theirs = table[table["data"] != "recording"].set_index("variant")
    long, short = theirs.loc["PGAE, long"], theirs.loc["PGAE"]
    assert set(long["steps"]) == {8 * short["steps"].iloc[0]}
    assert (long["describe_accuracy"].min().round(), long["describe_accuracy"].max().round()) == (
        83, 89)  # fmt: skip
    assert (long["describe_accuracy_new_scenes"] > 93).all()
    assert long["describe_accuracy_known_scenes"].median() == pytest.approx(80, abs=3)
    assert long["execute_nrmse"].median() < short["execute_nrmse"].median() / 5
    assert (long["execute_nrmse"].round(1) == 0.2).all()
    shuffled = long["execute_sentences_shuffled"] - long["execute_nrmse"]
    assert (shuffled.abs() < 0.005).all()
    assert (long["execute_sentence_blanked"].round(1) == 0.5).all()
    assert (long["execute_video_frozen"].round() == 16).all()
    ptae = theirs.loc[["PTAE, long"]]
    assert len(ptae) == 1 and ptae["execute_nrmse"].round(2).tolist() == [0.15]
    assert ptae["execute_nrmse"].max() < long["execute_nrmse"].min()


def test_on_the_authors_data_the_last_third_of_a_long_training_brings_hardly_more():
    curves = pd.read_csv(artefacts.stored("results/family_curves.csv"))
    own = curves[(curves["data"] != "recording") & (curves["variant"] == "PGAE, long")]
    mean = own.groupby("epoch")["describe_accuracy"].mean()
    assert mean.index.max() == 480 and round(mean[480] - mean[320]) == 1


def test_what_little_knowledge_gives_is_another_scale_on_each_data_set():
    table = pd.read_csv(artefacts.stored("results/family.csv"))
    assert (table.groupby("data").nunique().filter(like="reference_") <= 1).all(axis=None)
    known = table.groupby("data").first()
    ours, theirs = known.loc["recording"], known.loc["authors, 18 held out"]
    assert theirs["reference_hold_the_first_pose"] < theirs["reference_mean_trajectory"]
    assert ours["reference_mean_trajectory"] < ours["reference_hold_the_first_pose"]
    still = theirs["reference_hold_the_first_pose"] / ours["reference_hold_the_first_pose"]
    assert 0.45 < still < 0.55
    act = "reference_mean_of_action_word_and_side"
    assert (round(ours[act]), round(theirs[act])) == (3, 7)
    ptae = table[table["variant"] == "PTAE"].groupby("data")["execute_nrmse"].median()
    assert ptae["authors, 18 held out"] / theirs[act] == pytest.approx(1 / 8, abs=0.01)
    assert ptae["recording"] / ours[act] == pytest.approx(3 / 5, abs=0.03)
    assert pd.isna(theirs["reference_plan_from_the_true_places"])


@pytest.mark.slow
def test_the_stored_references_are_those_of_the_recording():
    samples = load_samples()
    table = pd.read_csv(artefacts.stored("results/family.csv"))
    stored = table[table["data"] == "recording"].iloc[0]
    now = references(samples, fit_scaling(samples, samples.split("train")))
    for name, (error, _) in now.items():
        assert stored[f"reference_{name.replace(' ', '_')}"] == pytest.approx(error, abs=0.002)


def describing(source, indices):
    indices = torch.as_tensor(indices)
    return build(source, indices, torch.full_like(indices, signal_number("describe")), 0 * indices)


def padded(keys):
    return torch.cat([keys[:, ::2], torch.zeros_like(keys[:, ::2])], dim=1)


@torch.no_grad()
def code(ptae, source, indices, change):
    batch = describing(source, indices)
    keys = change(batch.keys)
    words = ptae.model.words_in(batch.tokens, batch.token_mask).float()
    there = torch.ones(keys.shape[:2], dtype=torch.bool)
    return ptae.model.encoder(words, batch.token_mask, keys, there)[0]


def test_zeros_behind_a_clip_decide_the_speed_word(asked):
    """The verdict of "Where is the time?", of the model that the page asks."""
    ptae, samples, source, test = asked

    def fast(indices, change):
        with torch.no_grad():
            third = ptae.model.language(code(ptae, source, indices, change), 4)[:, 2].argmax(1)
        return np.mean([VOCABULARY[word] in ("fast", "quickly") for word in third.tolist()])

    slow, quick = test[samples.frames[test] == 100], test[samples.frames[test] == 50]
    assert fast(slow, lambda keys: keys[:, ::2]) < 0.05 and fast(slow, padded) > 0.95
    assert fast(quick, lambda keys: keys[:, :50]) < 0.05


def test_the_code_moves_with_the_zeros_and_hardly_with_the_frames(asked):
    ptae, samples, source, test = asked
    slow = test[samples.frames[test] == 100]
    whole = code(ptae, source, slow, lambda keys: keys)
    far = (whole - code(ptae, source, slow, padded)).norm(dim=1).mean()
    near = (whole - code(ptae, source, slow, lambda keys: keys[:, ::2])).norm(dim=1).mean()
    assert far > 10 * near


def test_what_is_described_wrongly_is_a_colour_of_a_rare_pair(asked):
    ptae, samples, source, test = asked
    answer = evaluation.respond(ptae, source, test, "describe")
    wrong = test[~evaluation.correct(answer, samples, test)]
    right = evaluation.word_accuracy(answer, samples, test)
    assert right["action_accuracy"] == right["speed_accuracy"] == 100
    shown = pd.Series([p.arrangement for p in patterns() if p.split == "train"]).value_counts()
    for index in samples.pattern[wrong]:
        assert shown[patterns()[index].arrangement] == shown.min()
    rare = [shown[patterns()[index].arrangement] == shown.min() for index in samples.pattern[test]]
    assert sum(rare) > 2 * len(wrong)


def test_heads_look_at_home_at_the_stroke_and_at_the_padding(asked):
    """Of the clip in figure 3.8, and of the words in figure 2 of "A small error, taken apart"."""
    ptae, samples, source, test = asked
    look = evaluation.respond(ptae, source, [6 * video_patterns()[6]], "describe").attention[0]
    assert look[:, 0, :10].sum(1).max() > 0.5 and look[:, 0, 25:50].sum(1).max() > 0.5
    assert look[:, 1, 50:].sum(1).max() > 0.95
    fast = next(i for i in test if samples.frames[i] == 50)
    text = sentence(patterns()[samples.pattern[fast]].meaning)
    whole = incongruence.disturb_language(describing(source, [fast]), [text])
    with torch.no_grad():
        weights = ptae.model.encode(whole)[1][0]
    on_zeros = weights[:, 2:5, 50:].sum(2)  # action, colour, speed
    assert ((on_zeros[:, 2] > 0.9) & (on_zeros[:, :2].max(1).values < 0.1)).any()
    assert weights[:, 2:4, 10:25].sum(2).min(1).values.max() > 0.4


def test_of_the_words_of_execute_only_the_action_word_matters(asked, rows):
    ptae, samples, *_ = asked
    changes = {of: incongruence.false_word(of) for of in ("action", "colour")}
    changes["padding"] = controls.false_padding
    error = {name: paper for name, (paper, _) in
             controls.execute_errors(ptae, samples, changes).items()}  # fmt: skip
    own = rows[(rows["variant"] == "PTAE") & (rows["seed"] == 0)].iloc[0]
    assert own["execute_sentences_shuffled"] > 1.2 * own["execute_nrmse"]
    assert own["execute_sentence_blanked"] > own["execute_sentences_shuffled"]
    assert error["action"] > own["execute_sentence_blanked"]
    assert error["colour"] < 1.05 * own["execute_nrmse"]
    assert own["execute_speed_word_swapped"] < 1.05 * own["execute_nrmse"]  # and chapter 06:
    assert error["padding"] > 3 * own["execute_nrmse"]
