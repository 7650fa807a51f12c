"""Linear read-outs: exact on linear data, fitted on training samples, scored on test samples."""

from dataclasses import replace

import numpy as np
import pytest

from ptae_lite.errors import ConfigError
from ptae_lite.language import ACTIONS, COLOURS, pattern
from ptae_lite.vision import probes

TINY = 1e-12  # a penalty that does not count


@pytest.fixture
def rng():
    return np.random.default_rng(0)


def test_a_linear_map_is_recovered(rng):
    features = rng.normal(3, [0.01, 1, 50], (40, 3))
    weights, offset = rng.normal(size=(3, 2)), np.array([7.0, -100.0])
    read = probes.fit_regression(features, features @ weights + offset, TINY)
    fresh = rng.normal(size=(10, 3))
    np.testing.assert_allclose(read.numbers(fresh), fresh @ weights + offset, atol=1e-6)


def test_a_penalty_shrinks_by_the_formula(rng):
    """One feature of unit spread: the weight is the covariance over one plus the penalty."""
    x = rng.normal(size=500)
    x = (x - x.mean()) / x.std()
    y = 3 * x + rng.normal(size=500)
    read = probes.fit_regression(x[:, None], y[:, None], 0.5)
    assert read.weights[0, 0] == pytest.approx(np.mean(x * (y - y.mean())) / 1.5)
    assert read.offset[0] == pytest.approx(y.mean())


def test_a_feature_that_never_changes_does_no_harm(rng):
    features = np.c_[rng.normal(size=30), np.full(30, 4.0)]
    read = probes.fit_regression(features, features[:, :1], TINY)
    np.testing.assert_allclose(read.numbers(features), features[:, :1], atol=1e-9)


def test_labels_are_the_class_with_the_largest_number(rng):
    labels = np.arange(60) % 3
    features = np.eye(3)[labels] + 0.05 * rng.normal(size=(60, 3))
    read = probes.fit_classifier(features, labels)
    np.testing.assert_array_equal(read.labels(features), labels)
    np.testing.assert_array_equal(read.labels(np.eye(3)[[2, 0, 1]]), [2, 0, 1])


@pytest.mark.parametrize(
    ("features", "targets"),
    [((5, 2), (4, 1)), ((5, 2), (5,)), ((5,), (5, 1)), ((5, 2, 2), (5, 1))],
)
def test_samples_that_do_not_match_are_refused(features, targets):
    with pytest.raises(ConfigError, match="fitted on samples x features and samples x targets, no"):
        probes.fit_regression(np.ones(features), np.ones(targets))


@pytest.mark.parametrize("shape", [(4, 3), (2,), (4, 2, 1)])
def test_features_of_another_width_are_refused(unchecked, shape):
    read = probes.fit_regression(np.eye(5)[:, :2], np.ones((5, 1)))
    with pytest.raises(ConfigError, match="takes samples x 2 features, not"):
        read.numbers(np.ones(shape))


def test_first_and_last_frames(samples):
    np.testing.assert_array_equal(probes.first(samples.joints), samples.joints[:, 0])
    ends = probes.last(samples, samples.joints)
    np.testing.assert_array_equal(ends[0], samples.joints[0, 99])
    np.testing.assert_array_equal(ends[863], samples.joints[863, 49])


def test_what_is_to_be_read(samples):
    colours, acts = probes.colours(samples), probes.action_and_side(samples)
    for i in range(0, 864, 7):
        p = pattern(int(samples.pattern[i]))
        assert (COLOURS[colours["left"][i]], COLOURS[colours["right"][i]]) == (p.left, p.right)
        assert acts[i] == ACTIONS.index(p.action) + (3 if p.side == "right" else 0)


def test_only_test_samples_are_scored_and_only_training_samples_are_fitted(samples, rng):
    labels = probes.colours(samples)["left"]
    features = np.eye(6)[labels]
    assert probes.percent_right(samples, features, labels) == 100
    test = samples.split("test")
    wrong = features.copy()
    wrong[test[:54]] = np.eye(6)[(labels[test[:54]] + 1) % 6]
    assert probes.percent_right(samples, wrong, labels) == 75
    # what stands beside a test sample must not change what is read from training samples
    noise = labels.copy()
    noise[test] = rng.permutation(labels[test])
    expected = 100 * (noise[test] == labels[test]).mean()
    assert probes.percent_right(samples, features, noise) == pytest.approx(expected)


def test_a_read_out_cannot_learn_the_test_samples_by_heart(samples, rng):
    """400 random numbers a sample would be enough to, if it were fitted on them as well."""
    labels = probes.colours(samples)["left"]
    noise = rng.normal(size=(864, 400))
    assert probes.percent_right(samples, noise, labels) < 35  # guessing: 16.7


def test_places_are_read_in_millimetres(samples, rng):
    cubes = np.zeros((864, 2, 7))
    cubes[:, :, :2] = rng.uniform(0, 0.1, (864, 2, 2))
    features = cubes[:, :, :2].reshape(864, 4) @ rng.normal(size=(4, 4))
    exact = probes.place_errors_mm(samples, features, cubes, TINY)
    assert exact["per_axis"] < 1e-6 and exact["distance"] < 1e-6
    train, test = samples.split("train"), samples.split("test")
    places = 1000 * cubes[:, :, :2]
    spread = np.sqrt(((places[train].mean(0) - places[test]) ** 2).mean())
    assert exact["guess"] == pytest.approx(spread)
    blind = probes.place_errors_mm(samples, np.zeros((864, 4)), cubes)
    assert blind["per_axis"] == pytest.approx(blind["guess"])


def test_a_shift_of_the_test_cubes_alone_is_the_error(samples, rng):
    """3 mm forward and 4 mm to the side: 5 mm apart."""
    cubes = np.zeros((864, 2, 7))
    cubes[:, :, :2] = rng.uniform(0, 0.1, (864, 2, 2))
    features = cubes[:, :, :2].reshape(864, 4)
    moved = cubes.copy()
    moved[samples.split("test"), :, :2] += [0.003, 0.004]
    found = probes.place_errors_mm(samples, features, moved, TINY)
    assert found["distance"] == pytest.approx(5)
    assert found["per_axis"] == pytest.approx(np.sqrt((9 + 16) / 2))


def test_scores_follow_the_split_of_the_samples(samples):
    labels = probes.colours(samples)["right"]
    part = replace(samples, pattern=np.roll(samples.pattern, 6))  # other samples are for the test
    features = np.eye(6)[labels]
    features[samples.split("test")] = 0
    scores = [probes.percent_right(of, features, labels) for of in (samples, part)]
    assert scores[0] < 30 < scores[1]
