"""What chapter 05 says, held against the stored table; and where it asks a model, against that."""

from dataclasses import replace

import numpy as np
import pytest

from ptae_lite import artefacts
from ptae_lite.data.samples import load_samples
from ptae_lite.data.signals import Source
from ptae_lite.evaluation import respond
from ptae_lite.experiments import answer_source, incongruence, incongruence_table
from ptae_lite.experiments.incongruence import EXTRA_INPUT, Condition
from ptae_lite.language import parse, pattern
from ptae_lite.models import checkpoint
from ptae_lite.paper import reported

SEEDS = 3
WORDS, MOTIONS = ("describe", "repeat language"), ("repeat action", "execute")


@pytest.fixture(scope="module")
def table():
    found = incongruence_table.read(artefacts.stored("results/incongruence.csv"))
    return found.assign(value=found["accuracy"].fillna(found["nrmse"]))


@pytest.fixture(scope="module")
def regular(table):
    return table[table["model"] == "ptae_adam"]


@pytest.fixture(scope="module")
def costs(table):
    return incongruence_table.damage(table).set_index(["model", "signal"]).sort_index()


@pytest.fixture(scope="module")
def asked():
    """The model of chapter 05, the recording, its source for the model, the test samples."""
    samples = load_samples("recording")
    ptae = checkpoint.load(artefacts.stored("weights/ptae_adam.safetensors"))
    return ptae, samples, Source(ptae.dataset(samples)), samples.split("test")


def single(rows, signal, place, aspect, column="value"):
    """The seeds' values of one conflict."""
    rows = rows[(rows["signal"] == signal) & (rows["conflict_in"] == place)]
    return rows[rows["aspects"] == aspect][column]


def test_every_model_was_trained_three_times_and_tried_under_everything(table):
    for name in incongruence_table.MODELS:
        rows = table[table["model"] == name]
        seeds = set(rows["seed"])
        assert seeds >= set(range(SEEDS)) and (name == "ptae") == (len(seeds) > SEEDS)
        assert len(rows) == len(incongruence_table.ALL) * len(seeds)
    assert not table.duplicated(incongruence_table.KEY).any()


def says(holds, sentence):
    """A sentence of chapter 05 (or of its page in depth) holds; else it is the one to mend."""
    assert np.all(holds), f"no longer true, mend it: {sentence}"


def test_the_format_costs_next_to_nothing(costs, regular):
    own = costs.loc["ptae_adam"]
    words, motions = own.loc[list(WORDS), "format"], own.loc[list(MOTIONS), "format"]
    says(words < 2, "A true extra input costs next to nothing (05, words)")
    says(motions < 0.15, "A true extra input costs next to nothing (05, motion)")
    says(own.loc["describe", "format"] <= 0, "where a true sentence helps (05, figure 5.3)")
    means = regular.groupby(["signal", "conflict_in"])["value"].mean()
    gap = means.xs("congruent_other", level=1) - means.xs("congruent", level=1)
    says(gap[list(WORDS)].abs() < 2, "A second control costs as little (05, words)")
    says(gap[list(MOTIONS)].abs() < 0.15, "A second control costs as little (05, motion)")


def test_the_asymmetry_is_there_with_every_seed(costs):
    own = costs.loc["ptae_adam", "conflict"]
    says(own["repeat language"].min() > own["describe"].max(),
         "The asymmetry is there, with every training (05, words)")  # fmt: skip
    says(own["repeat language"] > 95, "a false speed takes everything (05, figure 5.5)")
    says(own["execute"].min() > 3 * own["repeat action"].max(),
         "execute rises several times as much as repeat action (05)")  # fmt: skip


def test_our_curves_end_worse_than_the_papers_but_in_repeat_language(regular):
    sentence = "Apart from repeat language, our curves end worse than the paper's (05)"
    for signal, place in EXTRA_INPUT.items():
        rows = regular[(regular["signal"] == signal) & (regular["conflict_in"] == place)]
        three, paper = rows[rows["conflicts"] == 3]["value"], reported.CONFLICTS[signal][3].value
        if signal == "repeat language":
            says(three - paper < 2, sentence)
        else:
            says((three < paper) if signal in WORDS else (three > paper), sentence)


def test_one_false_action_misleads_and_often_it_is_followed(regular):
    rows = regular[(regular["signal"] == "repeat language") & (regular["conflict_in"] == "action")]
    one = rows[rows["conflicts"] == 1]
    says(one["distractor"].mean() > 35, "What the clip shows, as often as not (05, first guess)")
    says(one["neither"].mean() < 5, "Its wrong answers are good sentences (05, first guess)")
    for aspect in ("action", "position"):
        right = single(regular, "repeat language", "action", aspect)
        says((right > 10) & (right < 90), f"but not always (05, guess on a false {aspect})")


def test_speed_is_not_heard_but_seen(regular, costs):
    says(single(regular, "describe", "language", "speed") > 98,
         "A false word for the speed does nothing (05, figure 5.5)")  # fmt: skip
    true = regular[(regular["signal"] == "repeat action") & (regular["conflict_in"] == "congruent")]
    says(single(regular, "repeat action", "language", "speed") < true["value"].max() + 0.15,
         "repeat action is pale but for a false action (in depth, figure 1)")  # fmt: skip
    says(single(regular, "repeat language", "action", "speed", "speed_taken") > 95,
         "a clip of the wrong speed takes everything (05, figure 5.5)")  # fmt: skip
    for aspect in ("action", "position"):
        speed, other = (single(regular, "execute", "action", a) for a in ("speed", aspect))
        says(speed.min() > other.max(), "Execute suffers most from a false speed (in depth)")


def speeds(asked, blank):
    """Share of slow test clips whose repeated sentence is fast, with the last frames blank."""
    ptae, samples, source, test = asked

    def change(batch):
        keys = batch.keys.clone()
        keys[:, 100 - blank :] = 0
        return replace(batch, keys=keys)

    slow = test[samples.frames[test] == 100]
    answer = respond(ptae, source, slow, "repeat language", change=change)
    return np.mean([answer_source.decode_words(w).speed == "fast" for w in answer.words.argmax(2)])


def test_padding_is_the_speed(asked):
    says(speeds(asked, 0) < 0.05 < 0.95 < speeds(asked, 50),
         'The model reads "slowly" and says "fast" (05)')  # fmt: skip


def test_the_second_exercise_has_an_answer(asked):
    """A single blank frame is enough."""
    assert speeds(asked, 1) > 0.9


def test_the_first_exercise_has_an_answer(asked):
    """A false colour is believed more readily where the other cube has it."""
    ptae, samples, source, test = asked
    condition = Condition("describe", "language", ("colour",))
    false = incongruence.extra_inputs(samples, test, condition)
    answer = incongruence.respond_under(ptae, source, test, condition)
    believed: dict = {True: [], False: []}
    for i, text, words in zip(test, false, answer.words.argmax(2), strict=True):
        colour = parse(text).colour
        there = colour in pattern(int(samples.pattern[i])).arrangement
        believed[there].append(answer_source.decode_words(words).cube == colour)
    assert np.mean(believed[True]) > 2 * np.mean(believed[False])


def test_each_part_of_a_clip_alone_does_less_harm_than_both(regular):
    for signal in ("repeat language", "execute"):
        three = regular[(regular["signal"] == signal) & (regular["conflicts"] == 3)]
        whole, *parts = (
            three[three["conflict_in"] == place]["value"]
            for place in ("action", "vision", "proprioception")
        )
        sign = 1 if signal == "execute" else -1
        says([(sign * whole).min() > (sign * part).max() for part in parts],
             "each alone does less harm than both (05 and in depth)")  # fmt: skip
    for aspect in ("position", "action"):
        seen, felt = (single(regular, "repeat language", place, aspect)
                      for place in ("vision", "proprioception"))  # fmt: skip
        says(seen.max() < felt.min(),
             f"Repeat language takes a false {aspect} from the video (in depth)")  # fmt: skip


def test_a_false_clip_is_worse_than_none(regular):
    execute = regular[regular["signal"] == "execute"]
    blank = execute[execute["conflict_in"] == "blank"]["value"]
    rows = execute[execute["conflict_in"] == "action"]
    false_speed = rows["aspects"].str.contains("speed")
    says(blank.max() < rows[false_speed]["value"].min(),
         "A clip with a false speed is worse than no clip at all (in depth, figure 3)")  # fmt: skip
    says(rows[~false_speed]["value"].max() < blank.min(),
         "One with a false action or position alone is not (in depth, figure 3)")  # fmt: skip


def test_words_follow_and_motions_break(regular):
    conflict = regular[regular["conflict_in"].isin(["language", "action"])]
    one = conflict[conflict["conflicts"] == 1].groupby("signal").mean(numeric_only=True)
    more = conflict.groupby(["signal", "conflicts"]).mean(numeric_only=True)["mixture"]
    for signal in WORDS:
        says(one.loc[signal, "distractor"] > 2 * one.loc[signal, "neither"],
             "what is not the truth is mostly the distractor's (05)")  # fmt: skip
        says(more[signal, 1] <= more[signal, 2] <= more[signal, 3],
             "With more conflicts, more answers are mixtures (05)")  # fmt: skip
    three = conflict[conflict["conflicts"] == 3].set_index("signal")
    says(three.loc["repeat language", "speed_taken"] > 95, "the speed is the clip's (in depth)")
    moved = regular[(regular["conflicts"] > 0) & regular["signal"].isin(MOTIONS)]
    means = moved.groupby("signal").mean(numeric_only=True)
    says(means[["distractor", "mixture"]] < 2, "It does not become the distractor's (05)")
    lost = means["neither"]
    says((means["nearest_truth"] > 100 - lost / 2).loc["execute"],
         "Of those that count as neither, most are nearest to the true one (05)")  # fmt: skip


def at(table, model, signal, place):
    """The seeds' values under a condition without conflict, in the order of the seeds."""
    rows = table[(table["model"] == model) & (table["signal"] == signal)]
    return rows[rows["conflict_in"] == place].sort_values("seed")["value"].to_numpy()


def test_every_model_reaches_the_level(table):
    sentence = "Both models reach the regular level without extra input, each time (05)"
    for name in incongruence_table.MODELS:
        for signal in MOTIONS:
            worst = at(table, "ptae_adam", signal, "none").max()
            says(at(table, name, signal, "none") < 1.1 * worst, sentence)
        for signal in WORDS:
            worst = at(table, "ptae_adam", signal, "none").min()
            says(at(table, name, signal, "none") > worst - 3, sentence)
    says(at(table, "ptae_adam", "repeat language", "none") > 98,
         "it hardly ever fails (05, the hook)")  # fmt: skip


def gaps(costs, model, costly, cheap):
    """How much more three conflicts cost one signal than another, by seed."""
    paid = costs.loc[model].set_index("seed", append=True)["conflict"]
    return paid[costly] - paid[cheap]


def test_two_way_attention_takes_a_part_of_the_asymmetry_in_motion_away(costs):
    both, one = costs.loc["ptae_two_way_adam", "conflict"], costs.loc["ptae_adam", "conflict"]
    says(both["repeat action"].mean() > 2 * one["repeat action"].mean(),
         "A false sentence costs several times what it costs the regular model (05)")  # fmt: skip
    says(both["execute"].mean() < one["execute"].mean(),
         "a false clip costs execute a little less (in depth)")  # fmt: skip
    was, now = (gaps(costs, name, "execute", "repeat action")
                for name in ("ptae_adam", "ptae_two_way_adam"))  # fmt: skip
    says(0.4 < now.mean() / was.mean() < 0.65 and now.min() > 0,
         "The gap shrinks to little more than half (05 and in depth)")  # fmt: skip
    says(both["repeat action"].mean() - one["repeat action"].mean()
         > one["execute"].mean() - both["execute"].mean(),
         "mainly by harming repeat action (in depth)")  # fmt: skip


def test_two_way_attention_changes_little_in_words(costs):
    both = costs.loc["ptae_two_way_adam", "conflict"]
    says(both["repeat language"].min() > 90 and both["describe"].mean() > 50,
         "nearly all from repeat language, more than half from describe (in depth)")  # fmt: skip
    was, now = (gaps(costs, name, "repeat language", "describe")
                for name in ("ptae_adam", "ptae_two_way_adam"))  # fmt: skip
    says(0.7 < now.mean() / was.mean() < 1.1, "In words it hardly changes (05)")


def test_in_one_two_way_training_the_format_costs_as_much_as_the_conflict(costs):
    seeds = costs.loc[("ptae_two_way_adam", "repeat action")].set_index("seed")
    says(seeds.loc[1, "format"] > 0.7 * seeds.loc[1, "conflict"],
         "In one training the mere format cost as much (05, 07)")  # fmt: skip
    says(seeds.loc[[0, 2], "format"] < 0.3 * seeds.loc[[0, 2], "conflict"],
         "In one of its trainings (05, 07)")  # fmt: skip


def told_apart(table, model, aspects):
    """Accuracies of describe and of repeat language with conflicts other than of speed, by seed."""
    rows = table[(table["model"] == model) & table["conflict_in"].isin(["language", "action"])]
    rows = rows.replace({"aspects": {"position": "colour", "action position": "action colour"}})
    rows = rows[rows["aspects"] == aspects].set_index("signal")["value"]
    return rows["describe"], rows["repeat language"]


def test_without_speed_little_of_the_asymmetry_is_left(table, costs):
    heard, seen = told_apart(table, "ptae_adam", "action colour")
    own = costs.loc["ptae_adam", "conflict"]
    gap = own["repeat language"].mean() - own["describe"].mean()
    says(abs(heard.mean() - seen.mean()) < gap / 2, "most of it was the speed (05)")


def test_a_training_with_true_extra_input_turns_the_asymmetry_round(table):
    for aspects in ("action", "colour", "action colour"):
        heard, seen = told_apart(table, "ptae_congruent_adam", aspects)
        says(heard.max() < seen.min(), "the asymmetry has turned round (05, figure 5.8)")
    says(told_apart(table, "ptae_congruent_adam", "action")[0].max() < 15,
         "A false action word spoils nearly every description (05)")  # fmt: skip
    says(told_apart(table, "ptae_congruent_adam", "action colour")[1].min() > 85,
         "a clip with false action and cube spoils hardly any repetition (05)")  # fmt: skip
    rows = table[table["model"] == "ptae_congruent_adam"]
    says(single(rows, "repeat language", "action", "speed", "speed_taken") > 90,
         "Only the speed remains the clip's (05)")  # fmt: skip


def test_in_motion_the_false_action_turns_round_as_well(table):
    for model, sign in (("ptae_adam", 1), ("ptae_congruent_adam", -1)):
        rows = table[table["model"] == model]
        clip = single(rows, "execute", "action", "action")
        word = single(rows, "repeat action", "language", "action")
        says((sign * clip).min() > (sign * word).max(), "In motion it is the same (05)")
    rows = table[table["model"] == "ptae_two_way_adam"]
    clip = single(rows, "execute", "action", "action")
    word = single(rows, "repeat action", "language", "action")
    says(clip.mean() < word.mean(), "a gap stays, and two-way attention removes it (05)")


def test_a_conflict_hardly_moves_the_attention_and_the_format_does(asked):
    ptae, samples, source, test = asked
    slow = test[samples.frames[test] == 100]

    def look(condition, tokens=6):
        weights = incongruence.respond_under(ptae, source, slow, condition).attention
        return weights[:, :, :tokens].mean(dim=(0, 2)).numpy()

    for signal, place, aspects in (
        ("describe", "language", ("action", "colour", "speed")),
        ("repeat language", "action", ("action", "position")),
    ):
        calm = look(Condition(signal), 2 if signal == "describe" else 6)
        own, false = look(Condition(signal, "congruent")), look(Condition(signal, place, aspects))
        by_format, by_conflict = (
            50 * np.abs(a - b).sum(axis=1).mean() for a, b in ((calm, own), (own, false))
        )
        says(by_conflict < 15 and by_conflict < by_format / 2,
             "The format moves the attention, the conflict hardly (in depth)")  # fmt: skip


def test_in_words_the_model_of_chapter_03_believes_the_sentence(table, costs):
    own, rows = costs.loc["ptae", "conflict"], table[table["model"] == "ptae"]
    says(own["describe"].min() > own["repeat language"].max(),
         "In words it has changed sides, with every training (05, figure 5.9)")  # fmt: skip
    says(own["describe"].mean() > 80, "nearly 90 in describe (05, figure 5.9)")
    says(single(rows, "describe", "language", "action", "action_taken") > 75,
         "It repeats what it has read (05)")  # fmt: skip
    says(single(rows, "describe", "language", "speed") < 98,
         "Even a false speed word is heard (in depth)")  # fmt: skip
    whole = single(rows, "repeat language", "action", "speed")
    says((whole < 60).sum() == 3 and whole.min() > 40,
         "repeat language loses half to another speed with three of five (in depth)")  # fmt: skip
    for part in ("vision", "proprioception"):
        says(single(rows, "repeat language", part, "speed") > 95,
             "The video alone or the joints alone mislead it hardly ever (in depth)")  # fmt: skip


def test_in_motion_the_asymmetry_stays_and_both_costs_are_smaller(table, costs):
    own, was = costs.loc["ptae", "conflict"], costs.loc["ptae_adam", "conflict"]
    says(gaps(costs, "ptae", "execute", "repeat action") > 0, "In motion the asymmetry stays (05)")
    for signal in MOTIONS:
        says(own[signal].mean() < was[signal].mean(), "and both costs are smaller (05)")
    rows = table[table["model"] == "ptae"]
    false = rows[(rows["signal"] == "describe") & (rows["conflicts"] == 3)]
    says(false["mixture"] > 50, "most answers mix the false words with true ones (card)")
    for aspect in ("action", "position"):
        says(single(rows, "execute", "action", "speed").mean()
             > single(rows, "execute", "action", aspect).mean(),
             "In execute a false speed is still the worst (in depth)")  # fmt: skip


def test_with_the_better_step_the_remedies_do_something_else(table, costs):
    one, two, true = (costs.loc[name, "conflict"]
                      for name in ("ptae", "ptae_two_way", "ptae_congruent"))  # fmt: skip
    says(two["repeat language"].min() > 95 and 20 < two["describe"].mean() < 40,
         "two ways: a false clip takes all, a false sentence a third (in depth)")  # fmt: skip
    says(true["describe"].min() > one["describe"].max()
         and single(table[table["model"] == "ptae_congruent"], "describe", "language", "action")
         < 2, "no description survives a false action word (in depth)")  # fmt: skip
    wide, now = (gaps(costs, name, "execute", "repeat action")
                 for name in ("ptae", "ptae_two_way"))  # fmt: skip
    change = (wide - now).dropna()
    says(len(change) == 3 and (change > 0).sum() == 1,
         "two ways narrow the gap with one training of three (in depth)")  # fmt: skip
    own = costs.loc["ptae_two_way"].set_index("seed", append=True)
    for signal, least, most in (("execute", 0.45, 0.6), ("repeat action", 3, 10)):
        ratio = own.loc[signal, "format"] / own.loc[signal, "conflict"]
        says((ratio > least).sum() == 1 and ratio.max() < most,
             "half of the conflict, and several times as much, with one each")  # fmt: skip


def test_a_false_clip_harms_motion_more_in_every_training():
    path = artefacts.stored("results/incongruence.csv")
    for data in ("recording", "authors"):
        paid = incongruence_table.damage(incongruence_table.read(path, data))
        paid = paid.pivot(index=["model", "seed"], columns="signal", values="conflict")
        says(paid["execute"] > paid["repeat action"], "in every training of this book (in depth)")


def test_on_the_authors_data_the_clip_is_believed_more_but_not_always():
    rows = incongruence_table.read(artefacts.stored("results/incongruence.csv"), "authors")
    paid = incongruence_table.damage(rows).set_index(["model", "signal"]).sort_index()
    words = gaps(paid, "ptae", "repeat language", "describe")
    says(words.mean() > 0 and 0 < (words < 0).sum() < len(words) / 2,
         "the clip is believed more, and not with every training (in depth)")  # fmt: skip
    says(paid.loc[("ptae", "describe"), "conflict"] > 48, "describe loses half and more")
    says(gaps(paid, "ptae", "execute", "repeat action") > 0, "In motion it is there with each")
    own = paid.loc["ptae"]
    for signal in MOTIONS:
        of = own.loc[signal]
        says((of["format"] > 0.3).mean() > 0.5,
             "the format alone makes the motion worse (in depth)")  # fmt: skip
    clear = own.loc["execute"].query("format > 0.3")
    says((clear["format"] / clear["conflict"]).between(0.65, 0.82).all(),
         "execute loses about three quarters as much to a true clip (in depth)")  # fmt: skip
    more = gaps(paid, "ptae_two_way", "execute", "repeat action") - gaps(
        paid, "ptae", "execute", "repeat action"
    )
    says(len(more.dropna()) == 2 and more.dropna() > 0, "the gap grows with both two-way models")
    says(gaps(paid, "ptae_two_way", "repeat language", "describe") > 5,
         "in words the clip is still believed more (in depth)")  # fmt: skip
    true = paid.loc["ptae_congruent"]
    says(true.loc["describe", "conflict"] == 100, "gives all descriptions to the sentence")
    says(true["format"].abs().max() < 0.1, "and the format costs nothing any more (in depth)")
