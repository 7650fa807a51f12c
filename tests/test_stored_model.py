"""The trained model in `data/`: what it is, and that it still reaches its level."""

import pytest

from ptae_lite import artefacts, baselines, evaluation, training
from ptae_lite.data.samples import load_samples
from ptae_lite.data.scaling import fit_scaling
from ptae_lite.models import checkpoint


@pytest.fixture(scope="module")
def stored():
    return checkpoint.load(artefacts.stored("weights/ptae.safetensors"))


@pytest.fixture(scope="module")
def scores(stored):
    return evaluation.evaluate(stored, load_samples("recording"))


def test_it_was_trained_by_the_default_recipe_on_all_training_samples(stored):
    about, recipe = stored.about, training.Recipe()
    own = about["recipe"] | {"balanced": recipe.balanced}  # which is of no use with all labels
    assert training.Recipe(**own) == recipe  # what is newer than it has its default
    assert (about["split"], about["labelled"]) == ("train", 648)
    assert len(about["history"]) == recipe.epochs


def test_it_sees_through_the_stored_eye(stored):
    assert stored.about["encoder"] == artefacts.entry_of("weights/cae.safetensors")["sha256"]


def test_it_describes_the_test_samples(scores):
    assert scores["describe_accuracy"] >= 95
    assert scores["repeat_language_accuracy"] >= 99


def test_it_follows_the_film_of_the_test_samples(scores):
    """Better than the mean motion of the same action on the same side, which has 2.8 %."""
    samples = load_samples("recording")
    fitted = fit_scaling(samples, samples.split("train"))
    known, _ = baselines.references(samples, fitted)["mean of action word and side"]
    assert scores["execute_nrmse"] < known
    assert scores["repeat_action_nrmse"] < known
