"""The search for the regular recipes: one choice at a time, never on the test patterns."""

import json
from dataclasses import asdict, replace

import numpy as np
import pandas as pd
import pytest

import ptae_lite.__main__ as cli
from ptae_lite.data import batches
from ptae_lite.errors import ConfigError
from ptae_lite.experiments import recipes, runner, supervision
from ptae_lite.experiments.experiment import Experiment, Labels
from ptae_lite.models import MODELS


@pytest.fixture
def asked(monkeypatch, trained):
    """Trainings take no time; keeps what was asked of each."""
    kept = []

    def fit(one, *_):
        kept.append(one)
        return trained

    def score(trained, samples, *job):
        row = dict(zip(recipes.KEY, job, strict=True))
        return pd.DataFrame([row | {"describe_accuracy": 50.0 + len(kept)}])

    monkeypatch.setattr(Experiment, "fit", fit)
    monkeypatch.setattr(recipes, "STUDY", replace(recipes.STUDY, score=score, watch=None))
    return kept


def test_each_choice_changes_what_it_says_and_nothing_else(few):
    for model, mode, share, choice, seed in recipes.grid((4,)):
        found = recipes.experiment_of(few, "recording", model, mode, share, choice, seed)
        assert (found.model, found.split, found.seed) == (model, "fit", 4)
        regular = asdict(MODELS[model].recipe) | {"seed": 4}
        if mode == "iterations":
            assert found.labels == Labels("few updates")
            regular |= {"supervised": share / 100}
        else:
            assert found.labels == (Labels("random", 10) if share == 10 else Labels())
        assert asdict(found.recipe) == regular | recipes.CHOICES[choice].changes[model]
        assert (asdict(found.recipe) == regular) == (choice == "regular")


def test_no_two_rows_are_the_same_training(samples):
    rows = [recipes.experiment_of(samples, samples.name, *job) for job in recipes.grid()]
    assert len({one.hash for one in rows}) == len(rows)
    assert {one.model for one in rows} == {"ptae", "pgae", "pvae"}


def test_which_models_are_tried_with_few_labels():
    rows = recipes.grid((2,))
    assert {row[0] for row in rows if row[1:3] == ("samples", 10)} == {"ptae"}
    assert {row[0] for row in rows if row[1] == "iterations"} == {"ptae", "pgae"}
    assert recipes.grid((2,), ("pgae",), ("regular",), modes=("samples",)) == [
        ("pgae", "samples", 100.0, "regular", 2)]  # fmt: skip


def test_a_search_runs_what_is_missing_seed_by_seed(few, asked, tmp_path):
    def search(seeds, *choices):
        return recipes.study(few, tmp_path, recipes.grid(seeds, ("ptae",), choices, (100,)))

    search((1,), "regular", "slow")
    table = search((0, 1), "regular", "fast")
    assert [one.seed for one in asked] == [1, 1, 0, 0, 1] and len(table) == 5
    assert not table.duplicated(recipes.KEY).any()
    with pytest.raises(ConfigError, match="no choice 'guess'; there are regular; adam; no-decay"):
        search((0,), "guess")
    with pytest.raises(ConfigError, match="no model 'prae'; there are ptae; pgae; pvae"):
        recipes.grid(models=("prae",))
    with pytest.raises(ConfigError, match="no training is of pvae, samples, slow, 100 together"):
        recipes.grid(models=("pvae",), choices=("slow",), shares=(100,), modes=("samples",))


@pytest.mark.parametrize(("share", "labelled"), [(100.0, 552), (10.0, 56)])
def test_held_out_patterns_take_no_part_in_a_training(
    samples, small_experiments, monkeypatch, share, labelled
):
    """The real thing in small: watched and scored on held-out patterns, trained on the others."""
    seen, scored, build = set(), [], batches.build
    quick = replace(MODELS["ptae"].recipe, epochs=1, batch=54)
    monkeypatch.setattr(recipes, "recipe_of", lambda model, choice: quick)
    monkeypatch.setattr(batches, "build", lambda source, samples, *rest: (
        seen.update(samples.tolist()) or build(source, samples, *rest)))  # fmt: skip
    monkeypatch.setattr(supervision, "scores", lambda trained, samples, split: (
        scored.append(split) or {"describe_accuracy": 1.0}))  # fmt: skip
    job = ("recording", "ptae", "samples", share, "regular", 0)
    row = runner.work(recipes.STUDY, samples, None, job)
    assert tuple(row[recipes.KEY].iloc[0]) == job
    assert len(row) == 1 and row["labelled"].item() == labelled and scored == ["held_out"]
    assert seen and seen <= set(samples.split("fit").tolist())
    assert np.isnan(row["seconds_to_all"].item())  # an epoch describes nothing


def test_the_seconds_until_all_are_described(few, trained, monkeypatch):
    points = [{"epoch": e, "updates": 24 * e, "seconds": 9.0 * e, "describe_accuracy": right}
              for e, right in ((5, 100.0), (10, 98.0), (15, 100.0), (20, 100.0))]  # fmt: skip
    about = trained.about | {"watched": points, "labelled": 4, "supervised_samples_seen": 1}
    monkeypatch.setattr(supervision, "scores", lambda *_: {})
    monkeypatch.setattr(supervision, "examples", lambda *_: pd.DataFrame({"sample": [1]}))
    job = (few, "recording", "ptae", "samples", 100.0, "slow", 3)
    row = recipes.score(replace(trained, about=about), *job)
    assert row["seconds_to_all"].item() == 135


def test_the_command_runs_the_search(few, asked, monkeypatch, capsys, tmp_path):
    monkeypatch.setattr("ptae_lite.data.samples.load_samples", lambda *_: few)
    options = ["--models", "ptae", "--variants", "slow", "--seeds", "2", "--out", str(tmp_path)]
    assert cli.main(["study", "recipes", *options, "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["rows"] == 1
    assert asked[0].recipe.muon_lr == MODELS["ptae"].recipe.muon_lr / 2
