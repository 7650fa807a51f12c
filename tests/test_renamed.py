"""Who uses an old name is told the new one, in one sentence."""

import json

import pandas as pd
import pytest

from ptae_lite import artefacts, renamed
from ptae_lite.__main__ import main, settings
from ptae_lite.errors import ArtefactError, PTAEError
from ptae_lite.experiments import tables
from ptae_lite.models import checkpoint


@pytest.mark.parametrize(
    ("words", "new"),
    [
        (["study", "eyes"], "encoders"),
        (["features", "--eye", "x.safetensors"], "--encoder"),
        (["study", "encoders", "--eyes=build/eyes"], "--encoders"),
        (["study", "closed-loop", "--models", "blind"], "one_look_policy"),
    ],
)
def test_an_old_word_of_the_command_line_names_the_new_one(words, new, capsys):
    with pytest.raises(SystemExit) as stop:
        main(words)
    assert stop.value.code == 2
    assert f"is now called {new!r}" in capsys.readouterr().err


@pytest.mark.parametrize(("old", "new"), renamed.SETTINGS.items())
def test_an_old_setting_names_the_new_one(old, new):
    with pytest.raises(PTAEError, match=f"no setting '{old}'; '{old}' is now called '{new}'"):
        settings("ptae", [f"{old}=1"])


@pytest.mark.parametrize(("old", "new"), renamed.COLUMNS.items())
def test_an_old_column_names_the_new_one_and_the_table_stays(tmp_path, old, new):
    path = tmp_path / "table.csv"
    pd.DataFrame({old: [1], "seed": [0]}).to_csv(path, index=False)
    before = path.read_bytes()
    with pytest.raises(ArtefactError, match=f"'{old}' is now called '{new}'"):
        tables.add(path, pd.DataFrame({new: [1], "seed": [1]}), [new, "seed"])
    assert path.read_bytes() == before


def test_weights_with_old_settings_are_refused_by_name(tmp_path):
    tensors, about = artefacts.load_weights(artefacts.stored("weights/ptae.safetensors"))
    about = json.loads(json.dumps(about))
    about["config"]["film"] = about["config"].pop("freeze_video")
    artefacts.save_weights(tmp_path / "old.safetensors", tensors, about)
    with pytest.raises(ArtefactError, match="'film' is now called 'freeze_video'"):
        checkpoint.load(tmp_path / "old.safetensors")
