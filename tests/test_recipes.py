"""The search for the recipe of few labels: one choice at a time, never on the test patterns."""

import json
from dataclasses import asdict, replace

import pandas as pd
import pytest

import ptae_lite.__main__ as cli
from ptae_lite import training
from ptae_lite.data import batches
from ptae_lite.errors import ConfigError
from ptae_lite.experiments import recipes, supervision
from ptae_lite.experiments.supervision import Job
from ptae_lite.models import MODELS
from ptae_lite.training import RECIPES


@pytest.fixture
def asked(monkeypatch):
    """Trainings take no time; keeps what was asked of each."""
    kept = []

    def run_one(samples, job, recipe, split):
        kept.append((job, recipe, split))
        row = job._asdict() | {"data": "recording", "describe_accuracy": 50.0 + len(kept)}
        return pd.DataFrame([row]), None

    monkeypatch.setattr(supervision, "run_one", run_one)
    return kept


def test_each_choice_changes_one_number_of_the_recipe(few, asked):
    regular = asdict(RECIPES["ptae"])
    for choice, (_, changes) in recipes.CHOICES.items():
        recipes.run_one(few, choice, 4)
        job, recipe, split = asked[-1]
        assert job == Job("ptae", "samples", "balanced", 10, 4) and split == "fit"
        different = {k: v for k, v in asdict(recipe).items() if v != regular[k]}
        assert different == changes and len(different) == (choice != "regular")


def test_a_search_runs_what_is_missing_seed_by_seed(few, asked, tmp_path):
    recipes.study(few, tmp_path, ("regular", "once"), (1,))
    table = recipes.study(few, tmp_path, ("regular", "short"), (0, 1))
    seeds = [job.seed for job, *_ in asked]
    assert seeds == [1, 1, 0, 0, 1] and len(table) == 5
    assert not table.duplicated(recipes.KEY).any() and "model" not in table
    assert table.set_index(recipes.KEY)["describe_accuracy"]["recording", "short", 0] == 54
    with pytest.raises(ConfigError, match="no choice 'guess'; there are regular, once, short"):
        recipes.study(few, tmp_path, ("guess",))


def test_held_out_patterns_take_no_part_in_a_training(samples, small_configs, monkeypatch):
    """The real thing in small: scored on held-out patterns, trained on the others."""
    seen, scored, build = set(), [], batches.build
    small = {"ptae": MODELS["ptae"]._replace(config=lambda features: small_configs["ptae"])}
    monkeypatch.setattr(training, "MODELS", small)
    monkeypatch.setattr(recipes, "REGULAR", replace(RECIPES["ptae"], epochs=1, batch=54))
    monkeypatch.setattr(batches, "build", lambda source, samples, *rest: (
        seen.update(samples.tolist()) or build(source, samples, *rest)))  # fmt: skip
    monkeypatch.setattr(supervision, "scores", lambda trained, samples, split: (
        scored.append(split) or {"describe_accuracy": 1.0}))  # fmt: skip
    row = recipes.run_one(samples, "once", 0)
    assert row["labelled"].item() == 56 and scored == ["held_out"]
    assert seen and seen <= set(samples.split("fit").tolist())


def test_the_command_runs_the_search(few, asked, monkeypatch, capsys, tmp_path):
    monkeypatch.setattr("ptae_lite.data.samples.load_samples", lambda *_: few)
    options = ["--variants", "slow", "--seeds", "2", "--out", str(tmp_path), "--json"]
    assert cli.main(["study", "recipes", *options]) == 0
    assert json.loads(capsys.readouterr().out)["rows"] == 1
    assert asked[0][1].learning_rate == RECIPES["ptae"].learning_rate / 2
