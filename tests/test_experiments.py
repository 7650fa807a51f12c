"""An experiment's hash, and the runner: what is missing is trained, and nothing else is taken."""

import os
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
import torch

from ptae_lite import artefacts
from ptae_lite.errors import ArtefactError, ConfigError
from ptae_lite.experiments import runner
from ptae_lite.experiments.experiment import Labels, experiment
from ptae_lite.experiments.registry import STUDIES
from ptae_lite.experiments.runner import Study
from ptae_lite.models import checkpoint

PRINT = """
import numpy as np
from ptae_lite.data.samples import Samples
from ptae_lite.experiments.experiment import Labels, experiment
few = Samples(*(np.ones((6, 100, k), np.float32) for k in (5, 3)), *np.full((3, 6), 7), "e" * 64)
how = {"labels": Labels("random", 10)}
print(experiment(few, "pgae", {"units": 10}, {"epochs": 3, "batch": 6}, 4, **how).hash)
"""


def changed(samples, **fields):
    return replace(experiment(samples), **fields)


@pytest.mark.slow
def test_a_hash_is_of_the_content_whatever_the_process_and_the_order(few, capsys):
    env = os.environ | {"PYTHONHASHSEED": "7"}
    other = subprocess.run([sys.executable, "-c", PRINT], capture_output=True, text=True, env=env)
    exec(PRINT.replace('"random", 10', '"random", 10.0'), {})
    assert other.stdout == capsys.readouterr().out, other.stderr
    a = experiment(few, recipe={"epochs": 3, "batch": 9})
    assert a.hash == experiment(few, recipe={"batch": 9, "epochs": 3}).hash
    assert a.hash == replace(a, name="another file").hash


def test_whatever_a_training_depends_on_changes_its_hash(few):
    base = experiment(few)
    others = [
        experiment(few, "pgae"), experiment(few, config={"hidden": 128}),
        experiment(few, recipe={"epochs": 79}), experiment(few, seed=1),
        experiment(replace(few, features=few.features + np.float32(1e-6))),
        experiment(replace(few, encoder="authors", holdout=18)),
        replace(base, split="fit"), replace(base, labels=Labels("random", 10)),
        replace(base, labels=Labels("covering", 10)), replace(base, labels=Labels("few updates")),
        replace(base, videos="noisy"), replace(base, videos="own episodes", base=base),
        replace(base, videos="own episodes", base=replace(base, split="fit")),
    ]  # fmt: skip
    hashes = {one.hash for one in [base, *others]}
    assert len(hashes) == 1 + len(others)


def test_a_setting_that_is_added_and_off_changes_no_hash(few):
    from dataclasses import make_dataclass

    base = experiment(few)
    fields = [(name, type(value), value) for name, value in vars(base.recipe).items()]
    for value, same in ((0.0, True), (False, True), ("", True), (0.5, False), ("on", False)):
        later = make_dataclass("Recipe", [*fields, ("later", object, value)], frozen=True)()
        assert (replace(base, recipe=later).hash == base.hash) == same


def test_what_does_not_exist_is_refused_with_what_does(few):
    with pytest.raises(ConfigError, match="no labels 'some'; there are all, random"):
        Labels("some")
    with pytest.raises(ConfigError, match="no model 'gpt'; there are ptae, pgae"):
        experiment(few, "gpt")
    with pytest.raises(ConfigError, match="no videos 'loud'; there are noisy"):
        experiment(few, videos="loud")


def test_weights_say_which_experiment_they_are_and_are_used_again(few, small_experiments, tmp_path):
    asked = experiment(few)
    first = runner.obtain(asked, few, tmp_path)
    again = runner.obtain(asked, few, tmp_path)
    assert len(small_experiments) == 1 and again.about["experiment"] == asked.hash
    pairs = zip(first.model.parameters(), again.model.parameters(), strict=True)
    assert all(torch.equal(a, b) for a, b in pairs)


def test_a_file_of_that_name_with_another_hash_is_refused(few, small_experiments, tmp_path):
    runner.obtain(experiment(few), few, tmp_path)
    other = experiment(few, recipe={"mixup": False})
    assert other.file == experiment(few).file
    with pytest.raises(ArtefactError, match="another training .*mixup True for False.*; move it"):
        runner.obtain(other, few, tmp_path)
    assert len(small_experiments) == 1


def test_an_experiment_of_other_samples_is_refused(few, small_experiments):
    with pytest.raises(ConfigError, match="the experiment is of recording .*, not of authors "):
        experiment(few).fit(replace(few, encoder="authors"))


def test_what_several_jobs_need_is_trained_once_and_first_what_others_build_on(
    few, small_experiments, monkeypatch, tmp_path
):
    from ptae_lite.experiments import videos

    monkeypatch.setattr(videos, "make", lambda *_: None)

    def experiment_of(samples, name, row):
        base = experiment(samples, name="base")
        if name == "base":
            return base
        return experiment(samples, name=name, videos="own episodes", base=base)

    def score(trained, samples, name, row):
        return pd.DataFrame([{"name": name, "row": row}])

    study = Study("rows.csv", ["name", "row"], experiment_of, score)
    jobs = [("later", 0), ("base", 0), ("later", 1)]
    table = runner.run(study, few, jobs, tmp_path, tmp_path / "w")
    assert [one.name for one in small_experiments] == ["base", "later"]
    assert table.values.tolist() == [["base", 0], ["later", 0], ["later", 1]]


def test_stored_weights_say_of_which_experiment_they_are_or_are_of_an_earlier_recipe():
    entries = artefacts.manifest()
    for name in [name for name in entries if name.startswith("weights/")]:
        about = artefacts.load_weights(artefacts.stored(name))[1]
        assert entries[name]["experiment"] == about.get("experiment", artefacts.EARLIER)
    checkpoint.load(artefacts.stored("weights/one_look_policy_seed0.safetensors"))


def test_every_study_says_what_it_is_and_what_it_understands():
    for study in STUDIES.values():
        assert study.__doc__ and callable(study.add_options) and callable(study.command)
