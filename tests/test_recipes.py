"""The search for the recipe of few labels: one choice at a time, never on the test patterns."""

import json
import shutil
from dataclasses import asdict, replace

import pandas as pd
import pytest

import ptae_lite.__main__ as cli
from ptae_lite import artefacts
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

    def score(trained, samples, data, choice, seed):
        row = {"data": data, "choice": choice, "seed": seed, "describe_accuracy": 50.0 + len(kept)}
        return pd.DataFrame([row])

    monkeypatch.setattr(Experiment, "fit", fit)
    monkeypatch.setattr(recipes, "STUDY", replace(recipes.STUDY, score=score))
    return kept


def test_each_choice_changes_one_number_of_the_recipe(few):
    regular = asdict(supervision.recipe_of("ptae"))
    for choice, (_, changes) in recipes.CHOICES.items():
        found = recipes.experiment_of(few, "recording", choice, 4)
        assert (found.model, found.split, found.seed) == ("ptae", "fit", 4)
        assert found.labels == Labels("random", 10)
        different = {k: v for k, v in asdict(found.recipe).items() if v != regular[k]}
        assert different == changes | {"seed": 4} and len(different) == 1 + (choice != "regular")


def test_a_search_runs_what_is_missing_seed_by_seed(few, asked, tmp_path):
    recipes.study(few, tmp_path, ("regular", "once"), (1,))
    table = recipes.study(few, tmp_path, ("regular", "short"), (0, 1))
    seeds = [one.seed for one in asked]
    assert seeds == [1, 1, 0, 0, 1] and len(table) == 5
    assert not table.duplicated(recipes.KEY).any()
    assert table.set_index(recipes.KEY)["describe_accuracy"]["recording", "short", 0] == 54
    with pytest.raises(ConfigError, match="no choice 'guess'; there are regular; once; short"):
        recipes.study(few, tmp_path, ("guess",))


def test_rows_that_are_stored_are_not_made_again(samples, asked, tmp_path):
    shutil.copy(artefacts.stored("results/recipes.csv"), tmp_path)
    before = (tmp_path / "recipes.csv").read_bytes()
    recipes.study(samples, tmp_path)
    assert not asked and (tmp_path / "recipes.csv").read_bytes() == before


def test_held_out_patterns_take_no_part_in_a_training(samples, small_experiments, monkeypatch):
    """The real thing in small: scored on held-out patterns, trained on the others."""
    seen, scored, build = set(), [], batches.build
    monkeypatch.setattr(recipes, "REGULAR", replace(MODELS["ptae"].recipe, epochs=1, batch=54))
    monkeypatch.setattr(batches, "build", lambda source, samples, *rest: (
        seen.update(samples.tolist()) or build(source, samples, *rest)))  # fmt: skip
    monkeypatch.setattr(supervision, "scores", lambda trained, samples, split: (
        scored.append(split) or {"describe_accuracy": 1.0}))  # fmt: skip
    row = runner.work(recipes.STUDY, samples, None, ("recording", "once", 0))
    assert "model" not in row and row["choice"].item() == "once"
    assert row["labelled"].item() == 56 and scored == ["held_out"]
    assert seen and seen <= set(samples.split("fit").tolist())


def test_the_command_runs_the_search(few, asked, monkeypatch, capsys, tmp_path):
    monkeypatch.setattr("ptae_lite.data.samples.load_samples", lambda *_: few)
    options = ["--variants", "slow", "--seeds", "2", "--out", str(tmp_path), "--json"]
    assert cli.main(["study", "recipes", *options]) == 0
    assert json.loads(capsys.readouterr().out)["rows"] == 1
    assert asked[0].recipe.learning_rate == MODELS["ptae"].recipe.learning_rate / 2
