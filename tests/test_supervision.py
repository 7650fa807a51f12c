"""The study of limited supervision: no label leaks, and a stopped study goes on."""

import json
import shutil
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
import torch
from torch import nn

import ptae_lite.__main__ as cli
from ptae_lite import artefacts, training
from ptae_lite.baselines import linear_describe_accuracy
from ptae_lite.data import batches
from ptae_lite.data.signals import SUPERVISED, signal_index, signal_number
from ptae_lite.errors import ConfigError
from ptae_lite.evaluation import evaluate
from ptae_lite.experiments import labels, recipes, supervision, supervision_grid, tables
from ptae_lite.experiments.supervision_grid import Job
from ptae_lite.language import alternatives, parse, patterns
from ptae_lite.models import MODELS, PVAE
from ptae_lite.paper import reported
from ptae_lite.training import Recipe

QUICK = Recipe(epochs=1, batch=8)
KEY = supervision.KEY
DESCRIBE, REPEAT_LANGUAGE = signal_number("describe"), signal_number("repeat language")
NEED_LABEL = {"ptae": SUPERVISED, "pgae": (*SUPERVISED, "repeat both")}


def job(share=50, seed=0, model="ptae", mode="samples", variant="paper"):
    return Job(model, mode, variant, share, seed)


@pytest.fixture
def small(monkeypatch, small_experiments):
    """Trainings are of tiny models; keeps what each of their steps was built from."""
    built, real = [], batches.build

    def build(source, samples, signals, alternative, hold, extra, told):
        built.append((samples.numpy(), signals.numpy(), told.numpy()))
        return real(source, samples, signals, alternative, hold, extra, told)

    monkeypatch.setattr(batches, "build", build)
    return built


class Idle(nn.Module):
    """Learns nothing: for what can be seen before any model sees it."""

    def __init__(self, config):
        super().__init__()
        self.action = nn.Linear(1, 1)

    def loss(self, batch, paired):
        return (self.action.weight.sum(), self.action.bias.sum())


@pytest.fixture
def idle(small, monkeypatch):
    """As `small`, at no cost: what a training draws does not depend on its model."""
    idle = {k: v._replace(network=Idle) for k, v in MODELS.items()}
    monkeypatch.setattr(training, "MODELS", idle)
    return small


@pytest.fixture
def trainings(monkeypatch, small):
    """Which jobs were done."""
    asked, real = [], supervision.score

    def score(trained, samples, job):
        asked.append(job)
        return real(trained, samples, job)

    monkeypatch.setattr(supervision, "score", score)
    return asked


def made(samples, job, recipe=None, split="train"):
    """The rows and the sentences of a job."""
    asked = supervision.experiment_of(samples, job, recipe, split)
    trained = None if asked is None else asked.fit(samples)
    found = supervision.score(trained, samples, job, split)
    return found[supervision.FILE], found.get(supervision.SENTENCES, pd.DataFrame())


def supervised(built, model="ptae"):
    """How often samples were shown with a signal that needs a label, and which they were."""
    numbers = [signal_number(signal) for signal in NEED_LABEL[model]]
    parts = [part[np.isin(signals, numbers)] for part, signals, _ in built]
    return sum(map(len, parts)), {int(i) for part in parts for i in part}


def test_each_training_has_a_file_of_weights_of_its_own(samples):
    asked = [supervision.experiment_of(samples, one) for one in supervision_grid.grid()
             if one.model != "linear"]  # fmt: skip
    files = {one.hash: one.file for one in asked}
    assert len(set(files.values())) == len(files) == len(asked)
    few = supervision.experiment_of(samples, job(5))
    assert files[few.hash] == "ptae_labelled_5_seed0.safetensors"


@pytest.mark.parametrize("variant", ["paper", "balanced", "shuffled-scenes", "covering"])
@pytest.mark.parametrize(
    ("model", "share"), [("ptae", 5), ("ptae", 50), ("ptae", 90), ("pgae", 25)]
)
def test_a_label_is_asked_of_labelled_samples_alone_and_they_of_nothing_else(
    few, idle, model, share, variant
):
    this = job(share, 3, model, variant=variant)
    trained = supervision.fit(few, this, Recipe(epochs=4, batch=8))
    chosen = set(supervision.labelled(few, this).tolist())
    count, asked = supervised(idle, model)
    assert len(idle) == trained.about["steps"] == 12
    assert asked and asked <= chosen and trained.about["labelled"] == len(chosen)
    assert trained.about["supervised_samples_seen"] == count
    numbers = [signal_number(signal) for signal in NEED_LABEL[model]]
    for part, signals, _ in idle:
        np.testing.assert_array_equal(np.isin(part, list(chosen)), np.isin(signals, numbers))
    if variant == "balanced":
        assert count == 12 * 8 / 2
    else:  # each sample once an epoch
        assert count == 4 * len(chosen)
        for epoch in range(4):
            parts = [part for part, *_ in idle[3 * epoch : 3 * epoch + 3]]
            assert sorted(np.concatenate(parts)) == few.split("train").tolist()


@pytest.mark.slow
@pytest.mark.parametrize("variant", ["paper", "balanced"])
def test_pvae_binds_labelled_pairs_alone(few, small, small_configs, monkeypatch, variant):
    bound, real = [], PVAE.loss

    def loss(self, batch, paired):
        bound.append(paired.numpy())
        changed = replace(
            batch, keys=torch.where(paired[:, None, None], batch.keys, batch.keys + 1)
        )
        found, moved = (real(self.eval(), each, paired)[2] for each in (batch, changed))
        if paired.any() and not self.config.variational:  # the rest does not count
            torch.testing.assert_close(found, moved)
        return real(self, batch, paired)

    monkeypatch.setattr(PVAE, "loss", loss)
    this = job(25, model="pvae", variant=variant)
    prae = replace(small_configs["pvae"], variational=False)
    monkeypatch.setitem(training.MODELS, "pvae", MODELS["pvae"]._replace(config=type(prae)))
    about = training.train(
        few, Recipe(epochs=2, batch=8, balanced=variant == "balanced"), model="pvae", config=prae,
        labelled=supervision.labelled(few, this),
    ).about  # fmt: skip
    chosen = supervision.labelled(few, this)
    for paired, (part, *_) in zip(bound, small, strict=True):
        np.testing.assert_array_equal(paired, np.isin(part, chosen))
    assert about["supervised_samples_seen"] == sum(paired.sum() for paired in bound)
    assert {int(i) for part, *_ in small for i in part} > set(chosen.tolist())


def test_a_blend_is_of_labelled_clips_alone(few, idle, monkeypatch):
    """Whatever partners are drawn: what was blended is to be described, and so is its partner."""
    seen, real = [], batches.mixup

    def mixup(batch, share, partner):
        made = real(batch, share, partner)
        own, other = idle[-1][0], idle[-1][0][partner]
        changed = ((made.keys != batch.keys).flatten(1).any(1) | (made.share < 1)).numpy()
        describe = (batch.tokens[:, 0] == signal_index("describe")).numpy()
        assert describe[changed].all() and describe[partner][changed].all()
        seen.extend([*own[changed], *other[changed]])
        return made

    monkeypatch.setattr(batches, "mixup", mixup)
    this = job(50)
    supervision.fit(few, this, Recipe(epochs=4, batch=8))
    assert seen and set(seen) <= set(supervision.labelled(few, this).tolist())


@pytest.mark.parametrize("mode", ["samples", "iterations"])
def test_unpaired_sentences_are_repeated_beside_the_scene_of_a_stranger(few, idle, mode):
    for variant in ("paper", "shuffled-scenes"):
        idle.clear()
        supervision.fit(few, job(25, mode=mode, variant=variant), Recipe(epochs=4, batch=8))
        own = np.concatenate([p == told for p, _, told in idle])
        signals = np.concatenate([signals for _, signals, _ in idle])
        assert own[signals != REPEAT_LANGUAGE].all()
        share = own[signals == REPEAT_LANGUAGE].mean()
        assert share == 1 if variant == "paper" else share < 0.3
    told = {int(t) for _, s, told in idle for t in told[s == REPEAT_LANGUAGE]}
    if mode == "samples":
        assert not told & set(supervision.labelled(few, job(25)).tolist())


@pytest.mark.parametrize(("model", "share"), [("ptae", 10), ("pgae", 50), ("ptae", 2)])
def test_few_supervised_updates_use_any_sample(few, idle, model, share):
    this = job(share, model=model, mode="iterations", variant="paper")
    about = supervision.fit(few, this, Recipe(epochs=40, batch=8)).about
    count, asked = supervised(idle, model)
    assert count / (40 * 24) == pytest.approx(share / 100, abs=0.03)
    assert about["supervised_samples_seen"] == count and about["labelled"] == 24
    assert asked <= set(few.split("train").tolist()) and len(asked) > 8
    if model == "pgae":  # describe, execute and repeat both share them equally
        signals = np.concatenate([signals for _, signals, _ in idle])
        shares = [np.mean(signals == signal_number(s)) for s in NEED_LABEL["pgae"]]
        np.testing.assert_allclose(shares, share / 300, atol=0.04)


def test_a_training_can_be_as_long_as_the_papers(few):
    asked = supervision.experiment_of(few, job(1, mode="iterations", variant="paper-length"))
    shown = asked.recipe.epochs * 24 * asked.recipe.batch  # updates of an epoch
    assert shown / (reported.STEPS["ptae"] * reported.BATCH) == pytest.approx(1, abs=0.01)


@pytest.mark.parametrize(
    ("variant", "times"), [("adam", 1), ("adam-long", 8), ("adam-paper-length", 31)]
)
def test_few_iterations_can_have_adam_alone(few, variant, times):
    asked = supervision.experiment_of(few, job(1, mode="iterations", variant=variant)).recipe
    ours = recipes.recipe_of("ptae", "adam")  # the choice that was compared on held-out patterns
    assert asked == replace(ours, epochs=ours.epochs * times, supervised=0.01)


@pytest.mark.parametrize("model", ["ptae", "pgae", "pvae"])
def test_with_all_labels_it_is_the_regular_training(few, small, small_configs, model):
    recipe = Recipe(epochs=1, batch=8)
    both = [
        supervision.fit(few, job(100, 1, model, variant="paper"), recipe),
        training.train(few, replace(recipe, seed=1), model=model, config=small_configs[model]),
    ]
    first, second = (torch.cat([p.flatten() for p in t.model.parameters()]) for t in both)
    assert torch.equal(first, second)
    assert both[0].about["labelled"] == 24


def test_the_regular_training_gives_a_row_of_either_experiment(few, small):
    rows, said = made(few, job(100, variant="paper"), QUICK)
    assert rows["mode"].tolist() == ["samples", "iterations"]
    assert rows["share"].tolist() == [100, 66.6] and len(said) == 12
    assert rows.drop(columns=["mode", "share"]).nunique().max() == 1
    rows, said = made(few, job(100, model="pvae", variant="paper"), QUICK)
    assert rows["mode"].tolist() == ["samples"] and len(said) == 6


def test_the_labelled_list_follows_its_seed_alone(few, idle):
    lists = []
    for seed, epochs in ((1, 2), (1, 3), (2, 2)):
        idle.clear()
        supervision.fit(few, job(20, seed), Recipe(epochs=epochs, batch=8))
        lists.append(supervised(idle)[1])
    assert lists[0] == lists[1] != lists[2]


def test_held_out_patterns_take_no_part_while_settings_are_chosen(samples, small):
    rows, _ = made(samples, job(1), Recipe(epochs=1, batch=54), "fit")
    seen = {int(i) for part, *_ in small for i in part}
    assert rows["labelled"].item() == 6 and seen <= set(samples.split("fit").tolist())


@pytest.mark.parametrize("share", [1, 2, 5])
def test_covering_labels_name_every_word_evenly(samples, share):
    train, sets = samples.split("train"), set()
    for seed in range(5):
        chosen = labels.cover(samples, train, share, seed)
        assert len(set(chosen)) == len(training.label(train, share, seed))
        assert set(chosen) <= set(train.tolist())
        meanings = [patterns()[i].meaning for i in samples.pattern[chosen]]
        for place, words in enumerate((3, 6, 2)):
            counts = pd.Series([m[place] for m in meanings]).value_counts()
            assert len(counts) == words and counts.max() - counts.min() <= 2
        sets.add(tuple(chosen))
    assert len(sets) == 5


def test_the_linear_baseline_is_scored_as_ever(few):
    chosen = training.label(few.split("train"), 50, 2)
    rows, said = made(few, job(50, 2, "linear", variant="random"))
    wanted = linear_describe_accuracy(few, chosen)
    assert rows["describe_accuracy"].item() == pytest.approx(wanted, abs=0.001)
    assert rows["labelled"].item() == 12 and not len(said)
    assert rows[["action_accuracy", "colour_accuracy", "speed_accuracy"]].min().min() >= wanted


def test_scores_are_those_of_the_evaluation_and_of_the_words(trained, few):
    scores = supervision.scores(trained, few)
    whole = evaluate(trained, few)
    assert {k: scores[k] for k in whole} == {k: round(v, 3) for k, v in whole.items()}
    assert set(scores) - set(whole) == {"action_accuracy", "colour_accuracy", "speed_accuracy"}


def test_sentences_are_of_test_clips_and_are_judged(trained, few):
    said = supervision.examples(trained, few)
    assert len(said) == 6 and set(said["sample"]) <= set(few.split("test").tolist())
    assert said["sample"].is_unique and said["sample"].is_monotonic_increasing
    for row in said.itertuples():
        meaning = patterns()[few.pattern[row.sample]].meaning
        assert parse(row.truth) == meaning
        assert row.right == (row.said in alternatives(meaning))


def test_the_grid_holds_both_experiments_three_times_and_no_training_twice():
    grid = supervision_grid.grid()
    assert len(grid) == len(set(grid))
    for model in ("ptae", "pgae"):
        for seed in (0, 1, 2):
            mine = [j for j in grid if (j.model, j.seed) == (model, seed)]
            for variant in ("paper", "balanced"):
                shares = {j.share for j in mine if (j.mode, j.variant) == ("samples", variant)}
                assert shares | {100} == set(supervision_grid.SHARES["samples"])
            shares = {j.share for j in mine if (j.mode, j.variant) == ("iterations", "paper")}
            assert shares | {66.6} == set(supervision_grid.SHARES["iterations"])
            assert [j.share for j in mine if j.regular] == [100]
    for variant, shares in (("paper", 5), ("balanced", 4)):
        mine = [j for j in grid if j.model == "pvae" and j.variant == variant]
        assert len(mine) == 3 * shares
    assert len({j.seed for j in grid if j.model == "linear" and j.share == 10}) == 20
    core = [j for j in grid if j.variant == "paper" and j.mode == "iterations"]
    assert [j.seed for j in core if j.model == "ptae"] == [0] * 5 + [1] * 5 + [2] * 5


def test_the_core_of_the_grid_is_the_grid_without_its_variants():
    whole, core = supervision_grid.grid(), supervision_grid.grid(core=True)
    assert core == whole[: len(core)]
    trained = [j for j in core if j.model != "linear"]
    assert {j.variant for j in trained} == {"paper"}
    assert {j.mode for j in trained if not j.regular} == {"samples", "iterations"}


def test_jobs_are_selected_by_their_fields():
    grid = supervision_grid.grid((0,))
    few = supervision_grid.select(grid, model=["pgae"], mode=None, share=[2.0, 66.6])
    # of the iterations, 66.6 % is the regular training: all samples
    assert {(j.model, j.share) for j in few} == {("pgae", 2), ("pgae", 66.6), ("pgae", 100)}
    assert {j.mode for j in few} == {"samples", "iterations"}
    for name, value in {"model": "gpt", "mode": "days", "variant": "half", "share": 3}.items():
        with pytest.raises(ConfigError, match=f"no {name} {value!r}; there are "):
            supervision_grid.select(grid, **{name: [value]})


def test_the_regular_training_is_found_by_either_of_its_names():
    grid = supervision_grid.grid((0,))
    regular = [job(100, variant="paper")]
    for mode, share in (("iterations", 66.6), ("samples", 100)):
        assert supervision_grid.select(grid, model=["ptae"], mode=[mode], share=[share]) == regular
    assert len(supervision_grid.select(grid, model=["ptae"], mode=["iterations"])) == 6 + 9


@pytest.mark.parametrize("chosen", [{"model": ["pvae"], "mode": ["iterations"]},
                                    {"variant": ["balanced"], "share": [100]}])  # fmt: skip
def test_a_choice_that_nothing_fits_is_refused(chosen):
    with pytest.raises(ConfigError, match="no training is of .* together; leave one of them out"):
        supervision_grid.select(supervision_grid.grid(), **chosen)


def test_a_baseline_has_all_its_draws_whatever_the_seeds():
    draws = {j.seed for j in supervision_grid.grid((0,)) if j.model == "linear" and j.share == 10}
    assert draws == set(range(supervision_grid.DRAWS))


def test_a_study_writes_a_row_for_each_training(few, trainings, tmp_path):
    jobs = [job(50), job(10, 1), job(10, model="linear", variant="random")]
    table = supervision.study(few, tmp_path, jobs, QUICK)
    assert trainings == jobs
    assert table[KEY].values.tolist() == [
        ["linear", "recording", "samples", "random", 10, 0],
        ["ptae", "recording", "samples", "paper", 10, 1],
        ["ptae", "recording", "samples", "paper", 50, 0],
    ]
    assert table["labelled"].tolist() == [3, 3, 12]
    by_scenes = table.columns.str.endswith("_scenes")
    assert table.loc[table["model"] == "ptae", ~by_scenes].notna().all(axis=None)
    assert table.loc[table["model"] == "linear", by_scenes].notna().all(axis=None)
    assert {"describe_accuracy", "execute_nrmse_valid",
            "repeat_action_nrmse", "seconds", "versions", "steps"} < set(table)  # fmt: skip
    pd.testing.assert_frame_equal(table, pd.read_csv(tmp_path / "supervision.csv"))


def test_what_is_there_is_not_trained_again(few, trainings, tmp_path):
    supervision.study(few, tmp_path, [job(10)], QUICK)
    before = (tmp_path / "supervision.csv").read_text()
    asked = []
    jobs = [job(10.0), job(66.6), job(100, variant="paper")]
    supervision.study(
        few, tmp_path, jobs, QUICK,
        progress=lambda results, total: asked.append(total) or results,
    )  # fmt: skip
    assert asked == [2] and trainings == [job(10), job(66.6), job(100, variant="paper")]
    after = (tmp_path / "supervision.csv").read_text()
    assert set(before.splitlines()[1:]) < set(after.splitlines()[1:])
    supervision.study(few, tmp_path, jobs, QUICK)
    assert len(trainings) == 3


def test_rows_that_are_stored_are_not_made_again(samples, trainings, tmp_path):
    shutil.copy(artefacts.stored("results/supervision.csv"), tmp_path)
    before = (tmp_path / "supervision.csv").read_bytes()
    there = tables.there(tmp_path / "supervision.csv", KEY)
    jobs = [j for j in supervision_grid.grid() if supervision.named(samples, j) in there]
    assert len(jobs) > 400
    supervision.study(samples, tmp_path, jobs)
    assert not trainings and (tmp_path / "supervision.csv").read_bytes() == before


def test_two_data_sets_may_share_a_table(few, trainings, tmp_path):
    theirs = replace(few, encoder="authors")
    for samples in (few, theirs):
        table = supervision.study(samples, tmp_path, [job(50)], QUICK)
    assert len(trainings) == 2 and table["data"].tolist() == ["authors", "recording"]


def test_a_stopped_study_keeps_what_was_finished_and_says_nothing_twice(
    few, trainings, monkeypatch, tmp_path
):
    """Stopped between the two tables of its second training."""
    real = tables.add

    def stop(path, rows, *rest):
        if path.name == "supervision.csv" and rows["share"].tolist() == [50]:
            raise KeyboardInterrupt
        real(path, rows, *rest)

    jobs = [job(10), job(50)]
    with monkeypatch.context() as patch, pytest.raises(KeyboardInterrupt):
        patch.setattr(tables, "add", stop)
        supervision.study(few, tmp_path, jobs, QUICK)
    assert pd.read_csv(tmp_path / "supervision.csv")["share"].tolist() == [10]
    supervision.study(few, tmp_path, jobs, QUICK)
    assert [j.share for j in trainings] == [10, 50, 50]
    said = pd.read_csv(tmp_path / "supervision_sentences.csv")
    assert not said.duplicated([*KEY, "sample"]).any()
    assert said["share"].tolist() == [10] * 6 + [50] * 6


def test_a_table_is_written_whole_or_stays_as_it_was(monkeypatch, tmp_path):
    path, key = tmp_path / "new" / "table.csv", ["share", "seed"]
    row = {"share": [10], "seed": [0], "score": [1.5]}
    tables.add(path, pd.DataFrame(row), key)
    before = path.read_text()

    def break_off(self, file, **options):
        file.write_text("sha")
        raise KeyboardInterrupt

    monkeypatch.setattr(pd.DataFrame, "to_csv", break_off)
    for name in ("table.csv", "other.csv"):
        with pytest.raises(KeyboardInterrupt):
            tables.add(path.with_name(name), pd.DataFrame(row | {"share": [50]}), key)
    assert path.read_text() == before
    assert not path.with_name("other.csv").exists()


def test_rows_of_the_same_training_are_replaced_and_others_kept_in_order(tmp_path):
    path, key = tmp_path / "table.csv", ["share", "seed"]
    for share, score in ((50, 1), (66.6, 2), (10, 3), (50.0, 4)):
        rows = {"share": [share] * 2, "seed": [0, 0], "said": ["a", "b"], "score": [score] * 2}
        tables.add(path, pd.DataFrame(rows), key)
    found = pd.read_csv(path)
    assert found["share"].tolist() == [10, 10, 50, 50, 66.6, 66.6]
    assert found["score"].tolist() == [3, 3, 4, 4, 2, 2]
    assert found["said"].tolist() == ["a", "b"] * 3
    only = pd.DataFrame({"share": [1], "seed": [0], "score": [1]})
    for _ in range(2):
        tables.add(tmp_path / "one.csv", only, key)
    assert len(pd.read_csv(tmp_path / "one.csv")) == 1


def test_the_command_runs_the_study(few, trainings, monkeypatch, capsys, tmp_path):
    monkeypatch.setattr("ptae_lite.data.samples.load_samples", lambda data, holdout: few)
    monkeypatch.setitem(MODELS, "ptae", MODELS["ptae"]._replace(recipe=QUICK))
    options = ["--models", "ptae", "--shares", "2", "66.6", "--modes", "iterations",
               "--variants", "paper", "--seeds", "3", "--workers", "1", "--out", str(tmp_path),
               "--json"]  # fmt: skip
    assert cli.main(["study", "supervision", *options]) == 0
    regular = job(100, 3, variant="paper")  # is 66.6 % of the iterations, too
    assert set(trainings) == {job(2, 3, mode="iterations", variant="paper"), regular}
    told = json.loads(capsys.readouterr().out)
    assert told["rows"] == 3 and told["table"].endswith("supervision.csv")
    assert cli.main(["study", "supervision", "--shares", "3", "--out", str(tmp_path)]) == 1
    assert "no share 3.0; there are 1, 2, 5" in capsys.readouterr().err


def test_without_the_extra_a_cluster_is_refused_in_one_sentence(few, monkeypatch, tmp_path):
    monkeypatch.setitem(__import__("sys").modules, "distributed", None)
    with pytest.raises(ConfigError, match="needs the package distributed, which is not installed"):
        supervision.study(few, tmp_path, [job()], QUICK, cluster="tcp://127.0.0.1:1")
