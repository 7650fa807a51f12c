"""Sentences for clips without a label: found from all clips, and from no hidden label."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from ptae_lite.baselines import linear_describe
from ptae_lite.data.samples import load_samples
from ptae_lite.experiments import pseudo_labels as module
from ptae_lite.experiments import supervision
from ptae_lite.experiments.experiment import Labels, experiment
from ptae_lite.experiments.supervision_grid import Job
from ptae_lite.language import MEANINGS, SIDES, patterns
from ptae_lite.training import label


@pytest.fixture(scope="module")
def recording():
    return load_samples("recording")


def sentences(samples, indices) -> list:
    return [patterns()[i].meaning for i in samples.pattern[indices]]


def test_true_sentences_without_a_label_are_not_used(recording):
    own = label(recording.split("fit"), 10, 3)
    without = np.setdiff1d(recording.split("fit"), own)
    found = module.pseudo_labelled(recording, "fit", own)
    hidden = recording.pattern.copy()
    hidden[without] = np.random.default_rng(0).permutation(hidden[without])
    again = module.pseudo_labelled(replace(recording, pattern=hidden), "fit", own)
    assert (found.pattern[without] == again.pattern[without]).all()
    others = np.setdiff1d(np.arange(len(recording.frames)), without)
    assert (found.pattern[others] == recording.pattern[others]).all()
    assert (found.split("fit") == recording.split("fit")).all()


@pytest.mark.parametrize("seed", [0, 1])
def test_more_sentences_are_right_than_the_linear_baseline_finds(recording, seed):
    split = recording.split("fit")
    own = label(split, 10, seed)
    without = np.setdiff1d(split, own)
    true = sentences(recording, without)
    found = sentences(module.pseudo_labelled(recording, "fit", own), without)
    read = module.linear_read(recording, own, without, "side")
    colours = module.spread_colours(recording, split, own)
    right = np.mean([a == b for a, b in zip(found, true, strict=True)])
    plain = linear_describe(recording, own, without)
    plain = np.mean([a == b for a, b in zip(plain, true, strict=True)])
    assert right > plain + 0.1
    place = np.searchsorted(split, without)
    named = [colours[side][i] for side, i in zip(read, place, strict=True)]
    assert [meaning.colour for meaning in found] == named


def test_a_colour_reaches_the_scenes_that_look_alike():
    rng = np.random.default_rng(0)
    scenes = np.concatenate([rng.normal(0, 1, (40, 3)), rng.normal(9, 1, (40, 3))])
    graph = module.scene_graph(scenes)
    assert np.allclose(graph, graph.T) and not graph[:40, 40:].any()
    assert np.abs(np.linalg.eigvalsh(graph)).max() == pytest.approx(1)
    labels = np.zeros((80, 2))
    labels[3, 0] = labels[77, 1] = 1
    spread = module.spread(graph, labels)
    assert (spread.argmax(1) == np.repeat([0, 1], 40)).all()
    once = labels + module.SPREAD * graph @ spread  # the rest point
    assert np.allclose(once, spread)


def test_the_arm_is_taken_out_of_a_scene(recording):
    rng = np.random.default_rng(0)
    joints = recording.joints.copy()
    joints[:, 0] = rng.normal(0, 0.1, joints[:, 0].shape)
    seen = recording.features.copy()
    z = (joints[:, 0] - joints[:, 0].mean(0)) / joints[:, 0].std(0)
    arm = np.column_stack([z, z**2]) @ rng.normal(0, 20, (10, seen.shape[2]))
    indices = recording.split("fit")
    posed = replace(recording, joints=joints)
    hidden = replace(posed, features=seen + arm[:, None])
    clear, found = (module.scenes(s, indices) for s in (posed, hidden))
    graphs = [module.scene_graph(s) > 0 for s in (clear, found)]
    assert (graphs[0] == graphs[1]).mean() > 0.999


def test_each_sentence_has_a_pattern_to_stand_for_it(recording):
    for split in ("train", "fit"):
        own = [patterns()[i] for i in module.patterns_of(split)]
        for meaning in MEANINGS:
            made = [module._pattern(own, *meaning, side) for side in SIDES]
            assert all(patterns()[i].meaning == meaning for i in made)
            assert [patterns()[i].side for i in made] == list(SIDES)
    one = [p for p in patterns() if p.side == "left"]
    assert patterns()[module._pattern(one, *MEANINGS[0], "right")].meaning == MEANINGS[0]


def test_few_labels_that_lack_a_side_are_no_accident(recording):
    split = recording.split("fit")
    left = [i for i in split if patterns()[recording.pattern[i]].side == "left"][:4]
    found = module.pseudo_labelled(recording, "fit", np.array(left))
    assert len(found.pattern) == len(recording.pattern)


def test_a_training_takes_found_labels_and_counts_true_ones(few, tiny):
    job = Job("ptae", "samples", "pseudo-labels", 25, 0)
    asked = supervision.experiment_of(few, job)
    assert asked.labels == Labels("pseudo", 25)
    own = experiment(few, "ptae", vars(tiny), {"epochs": 1, "batch": 12}, 0, labels=asked.labels)
    assert own.hash != replace(own, labels=Labels("random", 25)).hash
    trained = own.fit(few)
    assert trained.about["labelled"] == 6


def test_the_baseline_gets_found_labels_too(recording):
    rows = [
        supervision.score(None, recording, Job("linear", "samples", variant, 10, 0), "fit")
        for variant in ("random", "pseudo-labels")
    ]
    plain, found = (row[supervision.FILE].iloc[0] for row in rows)
    assert plain["labelled"] == found["labelled"] == 56
    assert found["describe_accuracy"] > plain["describe_accuracy"]
