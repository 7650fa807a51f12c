"""The data sheet and the model cards say what the stored files say."""

import re
from dataclasses import replace

import pandas as pd
import pytest

from ptae_lite import artefacts, language
from ptae_lite.book import data_sheet, model_cards
from ptae_lite.data.samples import load_samples
from ptae_lite.errors import ArtefactError


def test_the_data_sheet_counts_the_recording(monkeypatch):
    facts = data_sheet.facts()
    assert facts["samples"] == "864: 648 for training, 216 for the test"
    assert facts["patterns"] == f"{len(language.patterns())}, each in 6 variations"
    assert facts["movements in both parts"] == "0"
    samples = load_samples("recording")
    joints = samples.joints.copy()
    joints[samples.split("test")[0]] = joints[samples.split("train")[0]]
    monkeypatch.setattr(data_sheet, "load_samples", lambda name: replace(samples, joints=joints))
    copied = data_sheet.facts()
    assert copied["movements in both parts"] == "1" and copied["distinct movements"] == "863"


def test_each_file_of_the_recording_says_how_it_was_made():
    html = data_sheet.Files()._repr_html_()
    for name, entry in artefacts.manifest().items():
        assert (f"<td>{name}</td>" in html) == name.startswith("recording/")
        if name.startswith("recording/"):
            assert entry["command"] in html and entry["sha256"][:12] in html


def test_each_stored_model_has_a_card_with_its_scores():
    html = model_cards.Cards()._repr_html_()
    assert len(model_cards.names()) == html.count("<h3>") >= 4
    for name in model_cards.names():
        said = model_cards.card(name)
        assert said["file"].startswith(name) and said["file"] in html
        assert artefacts.entry_of(name)["command"] in said["made by"]
        assert any("trainings: " in value for value in said.values()), name


def test_a_card_takes_its_scores_and_size_from_the_tables():
    said = model_cards.card("weights/ptae.safetensors")
    table = pd.read_csv(artefacts.stored("results/family.csv"))
    (size,) = table.query("variant == 'PTAE'")["parameters"].unique()
    assert said["parameters"] == f"{size:,}"
    rows = table.query("data == 'recording' and variant == 'PTAE'")["execute_nrmse"]
    low, high = re.search(r"trainings: ([\d.]+) to ([\d.]+)", said["execute, NRMSE in %"]).groups()
    assert (float(low), float(high)) == (rows.min().round(2), rows.max().round(2))


def test_only_the_training_that_is_stored_gives_a_single_score():
    rows = pd.DataFrame({"seed": [0, 1], "steps": [5, 5], "execute_nrmse": [1.5, 2.0]})
    for steps, said in ((5, "1.50; 2 trainings: 1.50 to 2.00"), (6, "2 trainings: 1.50 to 2.00")):
        marked = model_cards._stored(rows, {"recipe": {"seed": 0}, "steps": steps})
        assert model_cards.scores(marked) == {"execute, NRMSE in %": said}
    assert model_cards.scores(marked.iloc[:0]) == {"scores": "not in the stored tables"}


def test_a_model_of_an_unknown_kind_is_named():
    with pytest.raises(ArtefactError, match=r"no card for weights/new_seed1\.safetensors"):
        model_cards.kind("weights/new_seed1.safetensors")
