"""The study of the family: rows, curves, each training once, and what is read from the tables."""

import json
import shutil
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from test_recording import end_workers

import ptae_lite.__main__ as cli
from ptae_lite import artefacts
from ptae_lite.errors import ConfigError
from ptae_lite.experiments import family, tables
from ptae_lite.models import MODELS
from ptae_lite.training import Recipe

TWO = ("PTAE", "PGAE, no repeat both")


@pytest.fixture
def quick(small_experiments):
    return small_experiments


def trained_of(asked):
    return [(one.name, one.seed) for one in asked]


@pytest.mark.slow
def test_a_row_and_a_curve_for_each_training(few, quick, tmp_path):
    table = family.study(few, tmp_path, TWO, (0, 1), weights=tmp_path / "weights")
    assert trained_of(quick) == [(name, seed) for seed in (0, 1) for name in TWO]
    assert table["variant"].tolist() == ["PGAE, no repeat both"] * 2 + ["PTAE"] * 2
    assert set(table["data"]) == {"recording"} and table["steps"].tolist() == [18] * 4
    assert table.filter(like="execute_").shape[1] == 6 and table.notna().all(axis=None)
    curves = pd.read_csv(tmp_path / "family_curves.csv")
    for _, curve in curves.groupby(["variant", "seed"]):
        assert curve["epoch"].tolist() == [5, 6] and curve["updates"].tolist() == [15, 18]
        assert curve["seconds"].is_monotonic_increasing
    names = {path.name for path in (tmp_path / "weights").iterdir()}
    assert "ptae_seed0.safetensors" in names and "pgae_no_repeat_both_seed1.safetensors" in names
    last = curves[(curves["variant"] == "PTAE") & (curves["epoch"] == 6)]
    scored = table[table["variant"] == "PTAE"]
    assert last["describe_accuracy"].tolist() == scored["describe_accuracy"].tolist()


@pytest.mark.slow
def test_what_is_there_is_not_trained_again(few, quick, tmp_path):
    family.study(few, tmp_path, TWO, (0,))
    before = (tmp_path / "family.csv").read_bytes()
    family.study(few, tmp_path, TWO, (0,))
    assert len(quick) == 2 and (tmp_path / "family.csv").read_bytes() == before


@pytest.mark.slow
def test_a_curve_that_weights_tell_of_is_not_trained_for(few, quick, tmp_path):
    before = family.study(few, tmp_path / "a", TWO, (0,), tmp_path / "w")
    again = family.study(few, tmp_path / "b", TWO, (0,), tmp_path / "w")
    assert len(quick) == 2
    pd.testing.assert_frame_equal(again, before)
    curves = [(tmp_path / name / "family_curves.csv").read_text() for name in "ab"]
    assert curves[0] == curves[1]


def test_rows_that_are_stored_are_not_made_again(samples, quick, tmp_path):
    shutil.copy(artefacts.stored("results/family.csv"), tmp_path)
    before = (tmp_path / "family.csv").read_bytes()
    family.study(samples, tmp_path, seeds=(0, 1, 2))
    assert not quick and (tmp_path / "family.csv").read_bytes() == before


@pytest.mark.slow
def test_a_study_stopped_between_its_tables_goes_on(few, quick, tmp_path, monkeypatch):
    real = tables.add

    def stop(path, *arguments):
        if path.name == "family.csv":
            raise KeyboardInterrupt
        real(path, *arguments)

    with monkeypatch.context() as patch, pytest.raises(KeyboardInterrupt):
        patch.setattr(tables, "add", stop)
        family.study(few, tmp_path, TWO[:1], (0,))
    family.study(few, tmp_path, TWO[:1], (0,))
    curves = pd.read_csv(tmp_path / "family_curves.csv")
    assert len(quick) == 2 and curves["epoch"].tolist() == [5, 6]


@pytest.mark.slow
def test_workers_give_the_rows_that_one_process_gives(tmp_path):
    """Side by side, results come in any order; the table does not show it."""
    kept = []
    tables.run(divmod, [(7, 2), (9, 4)], kept.append, 1, lambda results, total: results)
    side_by_side = []
    tables.run(divmod, [(7, 2), (9, 4)], side_by_side.append, 2, lambda results, total: results)
    end_workers()
    assert kept == [(3, 1), (2, 1)] and sorted(side_by_side) == sorted(kept)


def test_two_processes_that_add_to_one_table_lose_no_row(tmp_path):
    path = tmp_path / "rows.csv"
    todo = [(path, pd.DataFrame({"n": [number]}), ["n"]) for number in range(40)]
    tables.run(tables.add, todo, lambda _: None, workers=2)
    end_workers()
    assert pd.read_csv(path)["n"].tolist() == list(range(40))


def test_a_variant_that_does_not_exist_is_refused(few, tmp_path):
    with pytest.raises(ConfigError, match="no variant 'QTAE'; there are PTAE; PGAE; PVAE"):
        family.study(few, tmp_path, ("QTAE",))
    assert not list(tmp_path.iterdir())


def test_every_claim_is_about_variants_that_are_trained():
    assert all(name in family.VARIANTS for pair in family.CLAIMS.values() for name in pair)
    for model, choices, recipe in family.VARIANTS.values():  # each exists
        MODELS[model].config(**choices)
        Recipe(**recipe)


def test_the_command_runs_the_study(few, quick, tmp_path, monkeypatch, capsys):
    monkeypatch.setattr("ptae_lite.data.samples.load_samples", lambda data, holdout: few)
    options = ["--variants", "PTAE", "--seeds", "3", "--out", str(tmp_path), "--json"]
    assert cli.main(["study", "family", *options]) == 0
    made = json.loads(capsys.readouterr().out)
    assert trained_of(quick) == [("PTAE", 3)] and made["rows"] == 1


def test_updates_to_a_level_count_from_where_a_curve_stays_there():
    curve = pd.DataFrame({
        "variant": "PTAE", "seed": 0, "updates": [10, 20, 30, 40], "seconds": [1, 2, 3, 4],
        "describe_accuracy": [50, 96, 90, 97],
    })  # fmt: skip
    row = family.updates_to(curve, 95).iloc[0]
    assert (row["updates"], row["seconds"]) == (40, 4)
    assert np.isnan(family.updates_to(curve, 99).iloc[0]["updates"])
    assert family.updates_to(curve, 40).iloc[0]["updates"] == 10


def test_samples_of_a_stand_in_test_part_are_named_as_such(samples):
    theirs = replace(samples, encoder="authors")
    assert samples.name == "recording" and theirs.name == "authors"
    assert replace(theirs, holdout=18).name == "authors, 18 held out"


@pytest.fixture
def scored():
    return pd.DataFrame({
        "variant": ["PTAE"] * 3 + ["PGAE"] * 3 + ["PVAE"],
        "describe_accuracy": [97, 98, 99, 90, 91, 97, 100],
        "execute_nrmse": [1.8, 1.9, 2.0, 2.1, 2.2, 2.3, 1.7],
    })  # fmt: skip


def test_one_is_clearly_better_only_with_every_seed(scored):
    assert family.clearly_better(scored, "PTAE", "PGAE", "describe_accuracy") == "neither"
    assert family.clearly_better(scored, "PTAE", "PGAE", "execute_nrmse") == "PTAE"
    assert family.clearly_better(scored, "PGAE", "PTAE", "execute_nrmse") == "PTAE"
    for name in ("PVAE", "PRAE"):  # one training, and none
        answer = family.clearly_better(scored, "PTAE", name, "describe_accuracy")
        assert answer == "too few trainings"


def test_a_summary_names_the_spread(scored):
    found = family.summary(scored, ["describe_accuracy"])["describe_accuracy"]
    assert found["PTAE"].split() == ["98.0", "(97.0", "to", "99.0)"]
    assert found["PVAE"] == "100.0 (one seed)"
    alike = family.summary(scored.assign(describe_accuracy=99.99), ["describe_accuracy"])
    assert alike["describe_accuracy"]["PGAE"].split() == ["100.0", "(all)"]


def test_every_claim_has_a_row(scored):
    worse = scored[:3].assign(variant="PTAE, action as query", describe_accuracy=50.0)
    table = pd.concat([scored, worse]).assign(repeat_language_accuracy=1, repeat_action_nrmse=2)
    found = family.claims(table).set_index("claim")
    assert list(found.index) == list(family.CLAIMS)
    row = found.loc["language as query is better than action"]
    assert row["describe_accuracy"] == "PTAE" and row["execute_nrmse"] == "neither"
    assert found.loc["repeat both helps PGAE"]["execute_nrmse"] == "too few trainings"
