"""The study of eyes: scores, checkpoints of one training, going on, what counts as levelled off."""

import json
import shutil
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
import torch
from numpy.lib.stride_tricks import as_strided

import ptae_lite.__main__ as cli
from ptae_lite import artefacts, vision
from ptae_lite.data import frames
from ptae_lite.data.samples import with_features, write_features
from ptae_lite.errors import ArtefactError, ConfigError, RecordingError
from ptae_lite.experiments import encoder_scores, encoders, encoders_in_use, runner
from ptae_lite.experiments.encoder_training import folder_of
from ptae_lite.experiments.experiment import Experiment
from ptae_lite.language import COLOURS, pattern
from ptae_lite.robot import recorder
from ptae_lite.vision import probes

STEPS = {"separated 3x10": (0, 10, 20), "plain 10": (0, 10)}  # presentations, two a step


@pytest.fixture
def seen(samples):
    """The made-up samples with cubes that lie anywhere and move to anywhere."""
    rng = np.random.default_rng(5)
    cubes = np.zeros((864, 100, 2, 7), np.float32)
    cubes[..., :2] = rng.uniform(0, 0.1, (864, 100, 2, 2))
    return replace(samples, cubes=cubes)


@pytest.fixture
def pictures(seen):
    """(864, 4) images that say all: places, joints, colours and acts as grey levels of stripes."""
    at = encoder_scores.moments(seen)
    made = np.zeros((864, 4, 120, 1, 3), np.uint8)
    made[..., 110:, :, 0] = 255  # something coloured, too
    rows = np.arange(864)[:, None]
    told = np.concatenate(
        [
            2000 * seen.cubes[rows, at][..., :2].reshape(864, 4, 4),
            100 + 100 * seen.joints[rows, at],
        ],
        axis=2,
    )
    flags = np.zeros((864, 4, 18))
    for i, number in enumerate(seen.pattern):
        p = pattern(int(number))
        flags[i, :, COLOURS.index(p.left)] = flags[i, :, 6 + COLOURS.index(p.right)] = 200
        flags[i, :, 12 + number % 6] = 200
    told = np.concatenate([told, flags], axis=2).round().astype(np.uint8)
    for k in range(told.shape[2]):
        made[:, :, 4 * k : 4 * k + 4] = told[:, :, k, None, None, None]
    # All columns of an image are one in memory: 1 MB for 200.
    return as_strided(made, (864, 4, 120, 160, 3), (*made.strides[:3], 0, 1))


class Reads(torch.nn.Module):
    """An eye for those pictures: the stripes are its features, and it draws black."""

    def __init__(self, keep=27):
        super().__init__()
        self.keep = keep

    def encode(self, images):
        return images[:, 0, 0 : 4 * self.keep : 4, 0]

    def forward(self, images):
        return torch.zeros_like(images)


def test_moments_are_in_order_and_within_the_clip(samples):
    at = encoder_scores.moments(samples)
    assert at.shape == (864, len(encoder_scores.MOMENTS))
    assert not at[:, 0].any() and (at[:, 3] == samples.frames - 1).all()
    assert (np.diff(at, axis=1) > 0).all()
    assert len({tuple(row) for row in at}) == 12  # six variations, two lengths


@pytest.mark.parametrize("split", encoder_scores.PROBES)
def test_an_eye_that_says_all_is_read_right(seen, pictures, split):
    found = encoder_scores.scores(Reads(), pictures, seen)[split]
    whole = ("first_left", "first_right", "first_both", "last_both", "first_act", "last_act",
             "first_both_products", "last_both_products")  # fmt: skip
    for name in whole:
        assert found[name] == 100
    assert found["first_place_mm"] < 1 and found["last_place_mm"] < 1
    assert found["joints_r2"] > 0.99


def test_an_eye_that_says_only_places_knows_no_colours(seen, pictures):
    found = encoder_scores.scores(Reads(4), pictures, seen)["test"]
    assert found["first_place_mm"] < 1 and found["first_both"] < 20 and found["joints_r2"] < 0.05


def test_products_read_what_a_sum_cannot():
    """Whether two signs agree: half of it in the sum, all of it in the product."""
    rng = np.random.default_rng(0)
    signs = rng.choice([-1.0, 1.0], (400, 2))
    labels, known, asked = (
        (signs[:, 0] == signs[:, 1]).astype(int),
        np.arange(300),
        np.arange(300, 400),
    )
    more = encoder_scores.with_products(np.c_[7 + 3 * signs, np.full(400, 5.0)], known)
    assert more.shape == (400, 3 + 6)
    np.testing.assert_allclose(more[known][:, :2].std(0), 1)
    np.testing.assert_allclose(more[:, 3:6], more[:, :1] * more[:, :3])
    for inputs, low, high in ((signs, 0, 70), (more, 99, 100)):
        read = probes.fit_classifier(inputs[known], labels[known])
        assert low <= 100 * (read.labels(inputs[asked]) == labels[asked]).mean() <= high


@pytest.mark.slow
def test_scores_of_a_split_are_read_from_that_split_alone(seen, pictures):
    """Other pictures for the test samples change no score on held-out ones, and the other way."""
    before = encoder_scores.scores(Reads(), pictures, seen)
    for changed, other in (("test", "held_out"), ("held_out", "test")):
        spoilt = pictures.copy()
        spoilt[seen.split(changed), :, :100] = 7
        after = encoder_scores.scores(Reads(), spoilt, seen)
        same = other == "held_out"  # held-out samples are fitted on for the test
        assert (before[other] == after[other]) is same
        assert after[changed]["first_both"] < 20


def test_the_error_of_a_drawing_is_over_all_pixels_and_over_coloured_ones():
    images = np.zeros((2, 4, 120, 160, 3), np.uint8)
    images[0, 0, :60] = 102  # grey, 0.4
    images[1, 3, :30, :, 0] = 204  # red, 0.8: 90 of 480 x 160 rows of pixels
    found = encoder_scores.pixel_errors(Reads(), images)
    squares = (0.5 * 0.4**2 + 0.25 * 0.8**2 / 3) / 8
    assert found["pixel_error"] == pytest.approx(squares**0.5, abs=5e-5)
    assert found["colour_pixel_error"] == pytest.approx((0.8**2 / 3) ** 0.5, abs=5e-5)


def test_arithmetic_is_counted_by_hand():
    """Two operations for each weight and place; the gradient costs twice the way forward, but for
    the images, which need none."""
    places = {"encoder": (4800, 1200, 300, 12, 1, 1, 1), "decoder": (1, 1, 12, 300, 1200, 4800)}
    cae, forward, first = vision.CAE(1), 0, None
    for half, counts in places.items():
        layers = [x for x in getattr(cae, half) if hasattr(x, "weight")]
        for layer, count in zip(layers, counts, strict=True):
            cost = 2 * layer.weight.numel() * count
            forward, first = forward + cost, first or cost
    separated = encoders.mflop_an_image(vision.make_autoencoder("separated"))
    assert separated == pytest.approx(3 * (3 * forward - first) / 1e6)


def test_checkpoints_at_equal_compute_cost_the_same():
    cost = {
        name: encoders.mflop_an_image(vision.make_autoencoder(*made))
        for name, made in encoders.CAES.items()
    }
    apart, ten, plain = (own + encoders.LONG[name] for name, own in encoders.CHECKPOINTS.items())
    assert {*ten, plain[-1]} == {*plain, 128_000} and apart[2] == plain[1]
    for a, b in zip(apart[2:], plain[2:], strict=True):
        for name in ("plain 10", "plain 30"):
            assert b * cost[name] == pytest.approx(a * cost["separated 3x10"], rel=1e-3)
    assert all(n % vision.AutoencoderRecipe().batch == 0 for n in apart + ten)


@pytest.fixture
def study(seen, monkeypatch, tmp_path):
    """A function that runs the study with few, small images; and how often steps were taken."""
    images = np.random.default_rng(0).integers(0, 256, (100, 120, 160, 3), np.uint8)
    few = replace(seen, pattern=seen.pattern[::3], variation=seen.variation[::3],
                  frames=seen.frames[::3], joints=seen.joints[::3], cubes=seen.cubes[::3],
                  features=seen.features[::3])  # fmt: skip
    monkeypatch.setattr(vision, "AutoencoderRecipe", vision.AutoencoderRecipe)
    monkeypatch.setattr(
        vision.AutoencoderRecipe, "__init__", _two_a_step(vision.AutoencoderRecipe.__init__)
    )
    monkeypatch.setattr(frames, "training_images", lambda folder: images)
    monkeypatch.setattr(encoder_scores, "look", lambda folder, samples: None)
    monkeypatch.setattr(encoders, "PCAS", {"PCA 10": ("pca", 10)})
    monkeypatch.setattr(encoders, "IN_USE", {"equal": {"separated 3x10": 10, "plain 10": 10}})
    monkeypatch.setattr(recorder, "samples_in_order", lambda: [(0, 0), (1, 0)])
    clip = type("Clip", (), {"images": images})
    monkeypatch.setattr(recorder, "load_sequence", lambda folder, *sample: clip)
    both = encoder_scores.PROBES
    monkeypatch.setattr(
        encoder_scores,
        "scores",
        lambda encoder, looks, samples: {s: {"sum": sum_of(encoder)} for s in both},
    )

    def run(seeds=(0,), checkpoints=STEPS, work="work", **more):
        return encoders.study(few, "none", tmp_path, tmp_path / work, seeds, checkpoints, **more)

    run.folder, run.samples = tmp_path, few
    return run


def _two_a_step(real):
    def init(self, *args, **options):
        real(self, *args, **{"batch": 2} | options)

    return init


def sum_of(encoder):
    return round(float(sum(p.detach().abs().sum() for p in encoder.parameters())), 4)


@pytest.mark.slow
def test_a_study_has_rows_for_every_eye_checkpoint_and_split(study):
    table = study((0, 1))
    assert table["encoder"].value_counts().to_dict() == {
        "separated 3x10": 12,
        "plain 10": 8,
        "PCA 10": 2,
    }
    assert set(table["split"]) == set(encoder_scores.PROBES)
    assert not table.duplicated(encoders.KEY).any()
    long = table[(table["encoder"] == "separated 3x10") & (table["split"] == "test")]
    assert long.groupby("seed")["sum"].nunique().tolist() == [3, 3]
    assert long["sum"].nunique() == 6
    assert (long["gflop"] == (long["samples_seen"] * 0.245878272).round(1)).all()
    for name, seed, last in (("separated 3x10", 1, 20), ("plain 10", 0, 10)):
        folder = study.folder / "work" / folder_of(name, seed)
        about = artefacts.load_weights(folder / f"encoder_{last}.safetensors")[1]
        assert about["recipe"] == vars(vision.AutoencoderRecipe(steps=last // 2, seed=seed))
        assert [path.name for path in folder.glob("features*")] == ["features_10.npz"]
        assert encoders.features_are_of(
            folder / "features_10.npz", folder / "encoder_10.safetensors"
        )


def test_features_can_be_left_out(study):
    study((0,), {"plain 10": (10,)}, features=False)
    work = study.folder / "work"
    assert list(work.glob("*/encoder_*")) and not list(work.glob("*/features_*"))
    study((0,), {"plain 10": (10,)})
    assert len(list(work.glob("*/features_*"))) == 2  # of the CAE and of the PCA


@pytest.mark.slow
def test_a_row_is_what_a_training_of_that_length_gives(study):
    table = study().set_index(encoders.KEY)["sum"]
    images = frames.training_images("none")
    for samples_seen in (10, 20):
        encoder = vision.make_autoencoder("separated")
        vision.train_autoencoder(encoder, images, vision.AutoencoderRecipe(steps=samples_seen // 2))
        assert table["separated 3x10", 0, samples_seen, "test", "cpu"] == sum_of(encoder)


def test_drawings_are_of_each_eye_at_its_longest(study):
    study()
    with np.load(study.folder / "encoder_reconstructions.npz") as file:
        shown = dict(file)
    assert list(shown) == ["separated 3x10", "plain 10", "PCA 10"]
    weights = study.folder / "work" / "separated_3x10_seed0" / "encoder_20.safetensors"
    with torch.no_grad():
        expected = vision.load_autoencoder(weights)(
            vision.as_input(frames.images(encoder_scores.DRAWN))
        )
    found = shown["separated 3x10"]
    assert found.dtype == np.uint8 and found.shape == (4, 120, 160, 3)
    np.testing.assert_allclose(found / 255, expected.permute(0, 2, 3, 1), atol=0.002)
    splits = {pattern(key[0]).split for key in encoder_scores.DRAWN}
    assert splits == {"test"}


@pytest.mark.slow
def test_a_long_study_goes_further_and_draws_the_same(study, monkeypatch):
    monkeypatch.setattr(encoders, "LONG", {"separated 3x10": (40, 60), "plain 10": (20, 30)})
    monkeypatch.setitem(encoders.IN_USE, "four times", {"separated 3x10": 40, "plain 10": 40})
    regular = study()
    drawn = (study.folder / "encoder_reconstructions.npz").read_bytes()
    table = study(long=True)
    assert (study.folder / "encoder_reconstructions.npz").read_bytes() == drawn
    again = table.merge(regular[encoders.KEY])
    pd.testing.assert_frame_equal(again, regular)
    new = table.merge(regular[encoders.KEY], how="left", indicator=True).query(
        "_merge == 'left_only'"
    )
    made = {name: own["samples_seen"].tolist() for name, own in new.groupby("encoder")}
    assert made == {
        "separated 3x10": [40, 40, 60, 60],
        "plain 10": [20, 20, 30, 30],
    }  # two splits of each
    folder = study.folder / "work" / folder_of("separated 3x10", 0)
    assert {path.name for path in folder.glob("features*")} == {
        "features_10.npz", "features_40.npz"
    }  # fmt: skip
    shorter = study.folder / "work" / folder_of("plain 10", 0)
    assert [path.name for path in shorter.glob("features*")] == ["features_10.npz"]
    assert encoders.features_are_of(folder / "features_40.npz", folder / "encoder_40.safetensors")


@pytest.mark.slow
def test_a_study_that_was_stopped_goes_on_to_the_same_table(study):
    whole = study((0,), work="other").drop(columns="seconds")
    (study.folder / "encoders.csv").unlink()
    study((0,), {"separated 3x10": (0, 10)})
    parts = study().drop(columns="seconds")
    pd.testing.assert_frame_equal(parts, whole)
    before = (study.folder / "encoders.csv").read_bytes()
    study()
    assert (study.folder / "encoders.csv").read_bytes() == before


def test_encoders_that_are_stored_are_not_made_again(seen, monkeypatch, tmp_path):
    stored = pd.read_csv(shutil.copy(artefacts.stored("results/encoders.csv"), tmp_path))
    there = {name: set(own["samples_seen"]) for name, own in stored.groupby("encoder")}
    lengths = {name: there[name] & {*own} for name, own in encoders.CHECKPOINTS.items()}
    assert min(map(len, lengths.values())) >= 3
    before = (tmp_path / "encoders.csv").read_bytes()
    images = np.zeros((8 * there["PCA 10"].pop(), 1), np.uint8)
    monkeypatch.setattr(frames, "training_images", lambda folder: images)
    monkeypatch.setattr(encoder_scores, "look", lambda folder, samples: None)
    monkeypatch.setattr(runner, "obtain", lambda *_: pytest.fail("it was trained"))
    # What is made of the weights, which are not stored.
    monkeypatch.setattr(encoders, "write_features", lambda *_: None)
    monkeypatch.setattr(encoders, "write_reconstructions", lambda *_: None)
    encoders.study(seen, "none", tmp_path, tmp_path / "work", checkpoints=lengths)
    assert (tmp_path / "encoders.csv").read_bytes() == before


def test_a_checkpoint_between_two_that_are_there_is_what_a_training_of_its_length_gives(study):
    study((0,), {"plain 10": (0, 10)})
    table = study((0,), {"plain 10": (0, 6, 10)}).set_index(encoders.KEY)["sum"]
    encoder, images = vision.make_autoencoder("plain"), frames.training_images("none")
    vision.train_autoencoder(encoder, images, vision.AutoencoderRecipe(steps=3))
    assert table["plain 10", 0, 6, "test", "cpu"] == sum_of(encoder)


def test_files_say_which_training_they_are_of_and_another_is_refused(study):
    study((0,), {"plain 10": (10,)})
    work = study.folder / "work"
    made = {path.name: artefacts.load_weights(path)[1] for path in work.glob("*/*.safetensors")}
    assert list(map(len, (about["experiment"] for about in made.values()))) == [64] * 3
    assert sorted(made) == [
        "encoder_10.safetensors", "encoder_13.safetensors", "training_8.safetensors"
    ]  # fmt: skip
    folder = work / folder_of("plain 10", 0)
    other = vision.make_autoencoder("plain")
    vision.save_autoencoder(folder / "encoder_10.safetensors", other)
    (study.folder / "encoders.csv").unlink()
    with pytest.raises(ArtefactError, match="encoder_10.*another training .*does not say of which"):
        study((0,), {"plain 10": (10,)})


def test_a_training_that_was_stored_goes_on_to_the_same_bits(study, tmp_path):
    lengths, images = {"plain 10": (40, 80)}, frames.training_images("none")
    bench = encoders.Bench(study.samples, images, None, lengths, "cpu")
    asked = encoders.experiment_of(bench, "plain 10", 0, 80)
    whole = asked.base.fit(bench)
    stopped = runner.obtain(asked.base, bench, tmp_path)
    assert len(list(tmp_path.glob("*/training_*"))) == 2
    again = asked.base.load(tmp_path / asked.base.file)
    assert again.training.step == stopped.training.step == whole.training.step == 32
    for one in (stopped, again):
        pairs = zip(one.encoder.parameters(), whole.encoder.parameters(), strict=True)
        assert all(torch.equal(a, b) for a, b in pairs)


LENGTHS = (("plain 10", 0, 40), ("plain 10", 1, 40), ("plain 10", 1, 160), ("PCA 30", 0, 8))


@pytest.fixture
def work(seen, tmp_path):
    """Features of two eyes, one without chance, and one seed of the other longer trained."""
    for name, seed, length in LENGTHS:
        folder = tmp_path / "encoders" / folder_of(name, seed)
        folder.mkdir(parents=True, exist_ok=True)
        weights = folder / f"encoder_{length}.safetensors"
        vision.save_autoencoder(weights, vision.make_autoencoder("plain", 2), device="cuda")
        width = 3 + seed
        codes = np.repeat(seen.frames[:, None] / 100, seen.frames, axis=0) * np.ones(width)
        write_features(folder / f"features_{length}.npz", codes, weights)
    return tmp_path / "encoders"


def test_samples_are_seen_by_another_eye(seen, work):
    other = with_features(seen, work / "plain_10_seed1" / "features_40.npz")
    assert other.features.shape == (864, 100, 4) and other.encoder != seen.encoder
    np.testing.assert_allclose(other.features[0, :, 0], 1)
    np.testing.assert_allclose(other.features[863, :50, 3], 0.5)
    assert not other.features[863, 50:].any()
    np.testing.assert_array_equal(other.joints, seen.joints)


def test_features_of_another_recording_are_refused(few, work, tmp_path):
    path = work / "PCA_30_seed0" / "features_8.npz"
    with pytest.raises(RecordingError, match="does not hold features of 2700 frames"):
        with_features(few, path)
    np.savez(tmp_path / "x.npz", other=np.zeros(2700))
    for name in ("x.npz", "missing.npz"):
        with pytest.raises(RecordingError, match=name):
            with_features(few, tmp_path / name)


def test_every_eye_gets_a_ptae_of_each_seed_where_it_has_features(work):
    jobs = encoders_in_use.jobs_in(work, (0, 1, 2))
    assert jobs == [("plain 10", 0, 40), ("PCA 30", 0, 8), ("plain 10", 1, 40),
                    ("plain 10", 1, 160), ("PCA 30", 1, 8), ("PCA 30", 2, 8)]  # fmt: skip


@pytest.fixture
def asked(monkeypatch, trained):
    """Trainings and scores take no time; keeps what was trained, and on how many features."""
    kept = []

    def fit(one, samples, *_):
        kept.append((samples.features.shape[2], one.config.features, one.seed))
        return replace(trained, about={"steps": 7, "seconds": 3.4})

    def evaluate(trained, samples):
        return {"describe_accuracy": 50.12345, "width": samples.features.shape[2]}

    monkeypatch.setattr(Experiment, "fit", fit)
    monkeypatch.setattr(encoders_in_use, "evaluate", evaluate)
    return kept


def test_ptae_is_trained_on_what_the_eye_sees_and_scored_on_it(seen, work, asked, tmp_path):
    table = encoders_in_use.study(seen, tmp_path, work, (1,))
    assert asked == [(4, 4, 1), (4, 4, 1), (3, 3, 1)]
    row = table.set_index(encoders_in_use.KEY).loc["ptae", "plain 10", 1, 160]
    assert (row["steps"], row["describe_accuracy"], row["width"]) == (7, 50.123, 4)
    assert row["device"] == "cuda" and row["seconds"] == 3


def test_the_ptae_study_does_what_is_missing(seen, work, asked, tmp_path):
    encoders_in_use.study(seen, tmp_path, work, (0,))
    assert [seed for *_, seed in asked] == [0, 0]
    table = encoders_in_use.study(seen, tmp_path, work, (0, 1))
    assert [seed for *_, seed in asked] == [0, 0, 1, 1, 1]
    assert table[encoders_in_use.KEY].values.tolist() == [
        ["ptae", "PCA 30", 0, 8], ["ptae", "PCA 30", 1, 8], ["ptae", "plain 10", 0, 40],
        ["ptae", "plain 10", 1, 40], ["ptae", "plain 10", 1, 160],
    ]  # fmt: skip


def test_rows_that_are_stored_are_not_made_again(seen, asked, tmp_path):
    stored = pd.read_csv(shutil.copy(artefacts.stored("results/encoders_in_use.csv"), tmp_path))
    for model, rows in stored.groupby("model"):
        work = tmp_path / model
        for encoder, seed, length in rows[encoders_in_use.KEY[1:]].itertuples(index=False):
            path = encoders_in_use.features_of(work, encoder, seed, length)
            path.parent.mkdir(parents=True, exist_ok=True)
            path.touch()
        table = encoders_in_use.study(seen, tmp_path, work, models=[model])
        assert not asked
        pd.testing.assert_frame_equal(table, stored)


def test_a_model_that_no_encoder_is_followed_by_is_refused(seen, work, tmp_path):
    with pytest.raises(ConfigError, match="ptae; ptae_adam"):
        encoders_in_use.study(seen, tmp_path, work, models=["pgae"])


def test_without_features_the_study_of_ptae_says_how_to_make_them(seen, tmp_path):
    with pytest.raises(RecordingError, match="no features of an encoder; .*study encoders"):
        encoders_in_use.study(seen, tmp_path, tmp_path / "none")


@pytest.mark.parametrize(
    ("name", "module", "given", "own", "more"),
    [("encoders", encoders, ["of R", "R", "T", "W", [0, 2]], ["--recording", "R"],
      {"device": "cpu", "long": False, "features": True}),
     ("encoders-in-use", encoders_in_use, ["stored", "T", "W", [0, 2], ("ptae",)], [],
      {"cluster": None})],
)  # fmt: skip
def test_the_commands_run_the_studies(
    monkeypatch, capsys, tmp_path, name, module, given, own, more
):
    monkeypatch.chdir(tmp_path)

    def study(*asked, progress, **named):
        assert list(asked) == given and named == {"workers": 2} | more
        return pd.DataFrame({"encoder": [1, 2, 3]})

    monkeypatch.setattr("ptae_lite.data.samples.load_samples", lambda: "stored")
    monkeypatch.setattr("ptae_lite.data.samples.load_unseen", lambda folder: f"of {folder}")
    monkeypatch.setattr(module, "study", study)
    options = [*own, "--out", "T", "--encoders", "W", "--seeds", "0", "2"]
    assert cli.main(["study", name, *options, "--workers", "2", "--json"]) == 0
    made = json.loads(capsys.readouterr().out)
    assert made["rows"] == 3 and made["table"] == f"T/{module.FILE}"
