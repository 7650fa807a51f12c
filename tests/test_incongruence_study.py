"""The study of incongruence: a row for every condition, each model trained once, or loaded."""

import json
import shutil

import numpy as np
import pandas as pd
import pytest

import ptae_lite.__main__ as cli
from ptae_lite import artefacts
from ptae_lite.errors import ArtefactError, ConfigError
from ptae_lite.experiments import incongruence_table, tables
from ptae_lite.experiments.answer_source import SOURCES
from ptae_lite.experiments.incongruence import ASPECTS, EXTRA_INPUT, PLACES, Condition, conditions
from ptae_lite.models import checkpoint
from ptae_lite.training import Recipe

FEW = [Condition("describe"), Condition("describe", "language", ("colour",)),
       Condition("execute", "congruent")]  # fmt: skip


@pytest.fixture
def quick(monkeypatch, small_experiments):
    """Few conditions are tried, and no model is trained longer than the others."""
    real, models = incongruence_table.rows_of, incongruence_table.MODELS
    for name, variant in models.items():
        short = {key: value for key, value in variant.recipe.items() if key != "epochs"}
        monkeypatch.setitem(models, name, variant._replace(recipe=short))
    monkeypatch.setattr(
        incongruence_table, "rows_of",
        lambda trained, samples, seed: real(trained, samples, seed, wanted=FEW),
    )  # fmt: skip
    return small_experiments


def kinds(asked):
    return [(one.config.queries, one.recipe.p_congruent_input, one.seed) for one in asked]


@pytest.fixture(scope="module")
def table(samples, trained):
    return incongruence_table.rows_of(trained, samples, 0, "held_out")


@pytest.mark.slow
def test_the_table_has_a_row_for_every_condition(table):
    rows = list(zip(table["signal"], table["conflict_in"], table["aspects"], strict=True))
    assert len(rows) == len(set(rows)) == 69
    assert rows == [
        (c.signal, c.conflict_in, " ".join(c.aspects))
        for signal in EXTRA_INPUT for c in conditions(signal)
    ]  # fmt: skip
    for row in table.itertuples():
        named = row.aspects.split()
        assert len(named) == row.conflicts
        assert set(named) <= set(ASPECTS[EXTRA_INPUT[row.signal]])
        assert (row.conflict_in in PLACES[EXTRA_INPUT[row.signal]]) == bool(named)


def test_words_have_an_accuracy_and_motions_an_error(table):
    words = table["signal"].isin(["describe", "repeat language"])
    motions = ["nrmse", "nrmse_valid", "nearest_truth"]
    assert table.loc[words, "accuracy"].notna().all()
    assert table.loc[words, motions].isna().all(axis=None)
    assert table.loc[~words, "accuracy"].isna().all()
    assert (table.loc[~words, "nrmse"] < table.loc[~words, "nrmse_valid"]).all()
    assert table.loc[~words, "nearest_truth"].between(0, 100).all()


def test_every_answer_follows_someone(table):
    np.testing.assert_allclose(table[list(SOURCES)].sum(axis=1), 100)
    calm = table[table["conflicts"] == 0]
    assert not calm[["distractor", "mixture"]].any(axis=None)
    assert calm[["action_taken", "cube_taken", "speed_taken"]].isna().all(axis=None)
    right = table["accuracy"].dropna()
    np.testing.assert_allclose(table.loc[right.index, "truth"], right)
    for row in table[table["conflicts"] > 0].itertuples():
        taken = (row.action_taken, row.cube_taken, row.speed_taken)
        named = [a in row.aspects.split() for a in ASPECTS[EXTRA_INPUT[row.signal]]]
        assert [not np.isnan(share) for share in taken] == named


@pytest.mark.slow
def test_each_model_is_trained_once_and_its_rows_kept(few, quick, tmp_path):
    weights = tmp_path / "weights"
    found = incongruence_table.study(few, tmp_path, seeds=(0, 1), weights=weights)
    each = 2 * [("language", 0.0), ("both", 0.0), ("language", 0.5)]  # the second with Adam
    assert kinds(quick) == [(*kind, seed) for seed in (0, 1) for kind in each]
    assert len(found) == 6 * 2 * len(FEW) and set(found["model"]) == set(incongruence_table.MODELS)
    assert set(found["aspects"]) == {"", "colour"}
    assert len(list(weights.iterdir())) == 12
    before = (tmp_path / "incongruence.csv").read_bytes()
    incongruence_table.study(few, tmp_path, seeds=(0, 1), weights=weights)
    assert len(quick) == 12 and (tmp_path / "incongruence.csv").read_bytes() == before
    (tmp_path / "incongruence.csv").unlink()  # weights that are there are not trained again
    incongruence_table.study(few, tmp_path, seeds=(0, 1), weights=weights)
    assert len(quick) == 12 and (tmp_path / "incongruence.csv").read_bytes() == before


def test_a_study_that_was_stopped_goes_on(few, quick, tmp_path, monkeypatch):
    with monkeypatch.context() as patch, pytest.raises(KeyboardInterrupt):
        patch.setattr(incongruence_table, "rows_of", lambda *given: (_ for _ in ()).throw(
            KeyboardInterrupt))  # fmt: skip
        incongruence_table.study(few, tmp_path, ("ptae",), (0,), tmp_path / "w")
    assert not (tmp_path / "incongruence.csv").exists()
    incongruence_table.study(few, tmp_path, ("ptae",), (0,), tmp_path / "w")
    assert len(quick) == 1
    assert len(tables.there(tmp_path / "incongruence.csv", incongruence_table.KEY)) == len(FEW)


def test_weights_of_another_training_are_refused(few, quick, trained, tmp_path):
    incongruence_table.study(few, tmp_path / "a", ("ptae",), (0,), tmp_path)
    (tmp_path / "ptae_seed0.safetensors").rename(tmp_path / "ptae_two_way_seed0.safetensors")
    with pytest.raises(ArtefactError, match="ptae_two.* another training .*'language' for 'both'"):
        incongruence_table.study(few, tmp_path / "b", ("ptae_two_way",), (0,), tmp_path)
    checkpoint.save(tmp_path / "ptae_seed0.safetensors", trained)  # shorter, and of before
    with pytest.raises(ArtefactError, match="epochs 1 for 6; it does not say of which experiment"):
        incongruence_table.study(few, tmp_path / "b", ("ptae",), (0,), tmp_path)
    assert not (tmp_path / "b").exists()


def test_rows_that_are_stored_are_not_made_again(samples, quick, tmp_path):
    shutil.copy(artefacts.stored("results/incongruence.csv"), tmp_path)
    before = (tmp_path / "incongruence.csv").read_bytes()
    incongruence_table.study(samples, tmp_path)
    assert not quick and (tmp_path / "incongruence.csv").read_bytes() == before


def test_a_model_that_is_not_in_the_study_is_refused(few, tmp_path):
    with pytest.raises(ConfigError, match="no model 'pgae'; there are ptae; ptae_two_way; ptae_"):
        incongruence_table.study(few, tmp_path, ("pgae",))


def test_the_variants_differ_from_the_regular_model_in_one_thing_each():
    assert incongruence_table.MODELS["ptae"] == ({}, {})
    for _choices, changes in incongruence_table.MODELS.values():
        Recipe(**changes)


def test_the_command_runs_the_study(few, quick, tmp_path, monkeypatch, capsys):
    monkeypatch.setattr("ptae_lite.data.samples.load_samples", lambda data, holdout: few)
    options = ["--variants", "ptae", "--seeds", "3", "--out", str(tmp_path), "--json",
               "--weights", str(tmp_path / "weights")]  # fmt: skip
    assert cli.main(["study", "incongruence", *options]) == 0
    made = json.loads(capsys.readouterr().out)
    assert kinds(quick) == [("language", 0.0, 3)] and made["rows"] == len(FEW)
    assert (tmp_path / "weights" / "ptae_seed3.safetensors").exists()


def test_costs_are_of_the_format_and_of_the_conflict():
    rows = []
    for place, count, accuracy, error in (
        ("none", 0, 100, 1.0), ("congruent", 0, 90, 1.5), ("language", 3, 60, 3.0),
        ("action", 3, 60, 3.0), ("vision", 3, 95, 1.0),
    ):  # fmt: skip
        for signal in EXTRA_INPUT:
            word = signal in ("describe", "repeat language")
            rows.append({"model": "ptae", "seed": 0, "signal": signal, "conflict_in": place,
                         "conflicts": count, "accuracy": accuracy if word else np.nan,
                         "nrmse": np.nan if word else error})  # fmt: skip
    found = incongruence_table.damage(pd.DataFrame(rows)).set_index("signal")
    assert found.loc["describe", ["format", "conflict"]].tolist() == [10, 30]
    assert found.loc["execute", ["format", "conflict"]].tolist() == [0.5, 1.5]
