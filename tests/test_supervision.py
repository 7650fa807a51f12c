"""The study of limited supervision: no label leaks, and a stopped study goes on."""

import json
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

import ptae_lite.__main__ as cli
from ptae_lite import dataset, training
from ptae_lite.errors import ConfigError
from ptae_lite.evaluation import evaluate
from ptae_lite.language import alternatives, parse, patterns
from ptae_lite.models import PTAE
from ptae_lite.signals import SUPERVISED, signal_number
from ptae_lite.studies import supervision, tables
from ptae_lite.training import Recipe

QUICK = Recipe(epochs=1, batch=8)
KEY = ["share", "seed"]


@pytest.fixture
def small(monkeypatch, tiny):
    """Trainings are of a tiny model; keeps what each of their steps was built from."""
    built, real = [], training.build

    def build(source, samples, signals, alternative, hold):
        built.append((samples.numpy(), signals.numpy()))
        return real(source, samples, signals, alternative, hold)

    monkeypatch.setitem(training.MODELS, "ptae", (PTAE, lambda features: tiny))
    monkeypatch.setattr(training, "build", build)
    return built


@pytest.fixture
def trainings(monkeypatch, small):
    """Which (share, seed) were trained; a share in `broken` stops the study."""
    asked, real = [], supervision.run_one

    def run_one(samples, share, seed, recipe, split="train"):
        asked.append((share, seed, recipe.seed))
        return real(samples, share, seed, recipe, split)

    monkeypatch.setattr(supervision, "run_one", run_one)
    return asked


def supervised_samples(built):
    """Every sample that a step ever wired to describe or execute."""
    numbers = [signal_number(signal) for signal in SUPERVISED]
    return {int(s) for part, sig in built for s in part[np.isin(sig, numbers)]}


@pytest.mark.parametrize("share", [5, 25, 50, 90])
def test_no_step_asks_an_unlabelled_sample_for_what_needs_a_label(few, small, share):
    recipe = Recipe(epochs=2, batch=8, seed=3)
    row, trained = supervision.run_one(few, share, 3, recipe)
    labelled = training.label(few.split("train"), share, 3)
    assert len(small) == row["steps"] == trained.about["steps"] == 6
    assert len(supervised_samples(small)) > 0 and supervised_samples(small) <= set(
        labelled.tolist()
    )
    others = np.setdiff1d(few.split("train"), labelled)
    seen = {int(s) for part, _ in small for s in part}
    assert seen <= set(few.split("train").tolist()) and seen & set(others.tolist())
    supervised = sum(np.isin(s, [signal_number(x) for x in SUPERVISED]).sum() for _, s in small)
    assert row["supervised_presentations"] == supervised
    assert row["labelled"] == len(labelled) == trained.about["labelled"]


def test_with_all_labels_every_sample_is_asked_for_everything(few, small):
    row, _ = supervision.run_one(few, 100, 0, Recipe(epochs=4, batch=8))
    assert len(supervised_samples(small)) > 20  # each of 24 is missed in 1 of 81 cases
    assert row["labelled"] == 24 and row["supervised_presentations"] == 4 * 24 * 2 / 3


def test_a_share_that_rounds_up_to_all_is_the_regular_training(few, small):
    row, _ = supervision.run_one(few, 99.9, 0, QUICK)
    assert row["labelled"] == 24 and row["supervised_presentations"] == 16


def test_the_labelled_list_follows_its_seed_alone(few, small):
    lists = []
    for seed, epochs in ((1, 2), (1, 3), (2, 2)):
        small.clear()
        supervision.run_one(few, 20, seed, Recipe(epochs=epochs, batch=8, seed=seed))
        lists.append(supervised_samples(small))
    assert lists[0] == lists[1] != lists[2]


def test_held_out_patterns_take_no_part_while_settings_are_chosen(samples, small):
    row, _ = supervision.run_one(samples, 1, 0, Recipe(epochs=1, batch=54), "fit")
    seen = {int(s) for part, _ in small for s in part}
    assert row["labelled"] == 6 and seen <= set(samples.split("fit").tolist())


def test_scores_are_those_of_the_evaluation_and_of_the_words(trained, few):
    scores = supervision.scores(trained, few)
    whole = evaluate(trained, few)
    assert {k: scores[k] for k in whole} == {k: round(v, 3) for k, v in whole.items()}
    assert set(scores) - set(whole) == {"action_accuracy", "colour_accuracy", "speed_accuracy"}


def test_a_study_writes_a_row_for_each_training(few, trainings, tmp_path):
    table = supervision.study(few, tmp_path, (50, 10), (0, 1), QUICK)
    assert trainings == [(50, 0, 0), (10, 0, 0), (50, 1, 1), (10, 1, 1)]
    assert table[KEY].values.tolist() == [[10, 0], [10, 1], [50, 0], [50, 1]]
    assert table["labelled"].tolist() == [3, 3, 12, 12]
    assert table.notna().all(axis=None)
    assert {"model", "mode", "steps", "describe_accuracy", "execute_nrmse_valid"} < set(table)
    pd.testing.assert_frame_equal(table, pd.read_csv(tmp_path / "supervision.csv"))


def test_a_study_without_a_recipe_takes_the_default(few, monkeypatch, tmp_path):
    class Enough(Exception):
        pass

    def run_one(samples, share, seed, recipe):
        assert recipe == Recipe(seed=4)
        raise Enough

    monkeypatch.setattr(supervision, "run_one", run_one)
    with pytest.raises(Enough):
        supervision.study(few, tmp_path, (10,), (4,))


def test_what_is_there_is_not_trained_again(few, trainings, tmp_path):
    supervision.study(few, tmp_path, (10,), (0,), QUICK)
    before = pd.read_csv(tmp_path / "supervision.csv")
    jobs = []
    supervision.study(
        few, tmp_path, (10.0, 66.6), (0,), QUICK, progress=lambda todo: jobs.extend(todo) or todo
    )
    assert jobs == [(66.6, 0)]
    assert trainings == [(10, 0, 0), (66.6, 0, 0)]
    after = pd.read_csv(tmp_path / "supervision.csv")
    assert after["share"].tolist() == [10, 66.6]
    pd.testing.assert_frame_equal(after.iloc[:1], before, check_dtype=False)
    supervision.study(few, tmp_path, (10, 66.6), (0,), QUICK)
    assert len(trainings) == 2


def test_a_stopped_study_keeps_what_was_finished_and_says_nothing_twice(
    few, trainings, monkeypatch, tmp_path
):
    """Stopped between the two tables of its second training."""
    real = tables.add

    def stop(path, rows, key):
        if path.name == "supervision.csv" and rows["share"].tolist() == [50]:
            raise KeyboardInterrupt
        real(path, rows, key)

    monkeypatch.setattr(tables, "add", stop)
    with pytest.raises(KeyboardInterrupt):
        supervision.study(few, tmp_path, (10, 50), (0,), QUICK)
    assert pd.read_csv(tmp_path / "supervision.csv")["share"].tolist() == [10]
    monkeypatch.setattr(tables, "add", real)
    supervision.study(few, tmp_path, (10, 50), (0,), QUICK)
    assert [share for share, *_ in trainings] == [10, 50, 50]
    said = pd.read_csv(tmp_path / "supervision_sentences.csv")
    assert not said.duplicated([*KEY, "sample"]).any()
    assert said["share"].tolist() == [10] * 6 + [50] * 6


def test_a_table_is_written_whole_or_stays_as_it_was(monkeypatch, tmp_path):
    path = tmp_path / "new" / "table.csv"
    row = {"share": [10], "seed": [0], "score": [1.5]}
    tables.add(path, pd.DataFrame(row), KEY)
    before = path.read_text()

    def break_off(self, file, **options):
        file.write_text("sha")
        raise KeyboardInterrupt

    monkeypatch.setattr(pd.DataFrame, "to_csv", break_off)
    for name in ("table.csv", "other.csv"):
        with pytest.raises(KeyboardInterrupt):
            tables.add(path.with_name(name), pd.DataFrame(row | {"share": [50]}), KEY)
    assert path.read_text() == before
    assert not path.with_name("other.csv").exists()


def test_rows_of_the_same_training_are_replaced_and_others_kept_in_order(tmp_path):
    path = tmp_path / "table.csv"
    for share, score in ((50, 1), (66.6, 2), (10, 3), (50.0, 4)):
        rows = {"share": [share] * 2, "seed": [0, 0], "said": ["a", "b"], "score": [score] * 2}
        tables.add(path, pd.DataFrame(rows), KEY)
    found = pd.read_csv(path)
    assert found["share"].tolist() == [10, 10, 50, 50, 66.6, 66.6]
    assert found["score"].tolist() == [3, 3, 4, 4, 2, 2]
    assert found["said"].tolist() == ["a", "b"] * 3
    only = pd.DataFrame({"share": [1], "seed": [0], "score": [1]})
    for _ in range(2):
        tables.add(tmp_path / "one.csv", only, KEY)
    assert len(pd.read_csv(tmp_path / "one.csv")) == 1


def test_sentences_are_of_test_clips_and_are_judged(trained, few):
    said = supervision.examples(trained, few, 10, 2)
    assert said.columns.tolist() == ["share", "seed", "sample", "truth", "said", "right"]
    assert len(said) == 6 and (said[KEY] == [10, 2]).all(axis=None)
    assert set(said["sample"]) <= set(few.split("test").tolist())
    assert said["sample"].is_unique and said["sample"].is_monotonic_increasing
    for row in said.itertuples():
        meaning = patterns()[few.pattern[row.sample]].meaning
        assert parse(row.truth) == meaning
        assert row.right == (row.said in alternatives(meaning))


@pytest.mark.parametrize("share", [0, 101, -5])
def test_a_share_that_does_not_exist_is_refused_before_anything_is_trained(
    few, trainings, tmp_path, share
):
    with pytest.raises(ConfigError, match=f"a share of {share} % does not exist; it is above 0 to"):
        supervision.study(few, tmp_path / "new", (10, share), (0,), QUICK)
    assert trainings == [] and not (tmp_path / "new").exists()


def test_the_command_runs_the_study(few, monkeypatch, capsys, tmp_path):
    asked = {}

    def study(samples, folder, shares, seeds, progress):
        asked.update(folder=folder, shares=shares, seeds=seeds)
        return pd.DataFrame({"share": shares})

    monkeypatch.setattr(dataset, "load", lambda data: few)
    monkeypatch.setattr(supervision, "study", study)
    out = str(tmp_path / "results")
    options = ["--shares", "2", "66.6", "--seeds", "0", "1", "--out", out, "--json"]
    assert cli.main(["study", "supervision", *options]) == 0
    assert asked == {"folder": out, "shares": [2, 66.6], "seeds": [0, 1]}
    made = json.loads(capsys.readouterr().out)
    assert made["rows"] == 2 and made["table"].endswith("supervision.csv")


def test_tables_of_two_data_sets_are_not_mixed(few, trainings, tmp_path):
    supervision.study(few, tmp_path, (50,), (0,), QUICK)
    theirs = replace(few, eye="authors")
    assert theirs.name == "authors"
    with pytest.raises(ConfigError, match="is of another data set; choose another folder"):
        supervision.study(theirs, tmp_path, (10,), (0,), QUICK)
    assert len(trainings) == 1
