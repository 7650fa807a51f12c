"""The authors' layout, written from made-up numbers: read, refused where wrong, trained on."""

import json
import shutil
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

import ptae_lite.__main__ as cli
from ptae_lite import training
from ptae_lite.data import authors, splits
from ptae_lite.data.samples import load_authors, load_samples
from ptae_lite.data.scaling import HALF_WHITE, fit_scaling
from ptae_lite.errors import ConfigError, RecordingError
from ptae_lite.evaluation import nrmse
from ptae_lite.language import COLOURS, MEANINGS, VOCABULARY, alternatives, encode, patterns
from ptae_lite.models import PTAEConfig, checkpoint

RECORDINGS = ("201207", "201223")  # two of their six
SMALL = PTAEConfig(features=30, hidden=16, heads=2, feed_forward=32, decoder_units=12)


def matrix_text(rows) -> str:
    return "".join(" ".join(f"{x:.6f}" for x in row) + "\n" for row in rows)


def joints_of(p, variation):
    """From 0 to 1 and back, each joint from another place on; to six decimals, as on disk."""
    places = np.linspace(0, 2, p.frames)[:, None] + 0.3 * np.arange(5) + 0.1 * variation
    return np.abs((places + p.index / 144) % 2 - 1).round(6)


def features_of(p, variation):
    return (60 * np.sin(np.arange(p.frames * 30) * (p.index + 2) + variation)).reshape(-1, 30)


def write_folder(folder, parts=("train",), recordings=RECORDINGS):
    """Their layout: index files without a last newline, columns padded, one folder a recording."""
    speeds, all_patterns = {"slowly": "SLOW", "fast": "FAST"}, patterns()
    index = {
        "actions.txt": [
            f"{f'{p.action.upper()}-{p.side[0].upper()}-{speeds[p.speed]}':24}{p.split}"
            for p in all_patterns
        ],
        "arrangements.txt": [f"{p.left}+{p.right}" for p in all_patterns],
        "descriptions.txt": [alternatives(p.meaning)[k] for k in range(8) for p in all_patterns],
        "vocabulary.txt": ["<BOS/EOS>", *VOCABULARY[1:], "describe:", "execute:"],
    }
    folder.mkdir()
    for name, lines in index.items():
        (folder / name).write_text("\n".join(lines))
    language = {
        meaning: matrix_text(np.eye(23)[np.concatenate([encode(s) for s in alternatives(meaning)])])
        for meaning in MEANINGS
    }
    for p in all_patterns:
        if p.split not in parts:
            continue
        for variation, recording in enumerate(recordings):
            texts = {
                "behavior": matrix_text(joints_of(p, variation)),
                "vision": matrix_text(features_of(p, variation)),
                "language": language[p.meaning],
            }
            for stream, text in texts.items():
                path = folder / "target" / f"{stream}_{p.split}" / recording
                path.mkdir(parents=True, exist_ok=True)
                (path / f"target{p.index:06}.txt").write_text(text)
    return folder


@pytest.fixture(autouse=True)
def two_recordings(monkeypatch):
    monkeypatch.setattr(authors, "RECORDINGS", RECORDINGS)


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    return write_folder(tmp_path_factory.mktemp("whole") / "data", ("train", "test"))


@pytest.fixture(scope="module")
def training_part(whole, tmp_path_factory):
    folder = tmp_path_factory.mktemp("part") / "data"
    return shutil.copytree(whole, folder, ignore=shutil.ignore_patterns("*_test"))


@pytest.fixture
def change(whole):
    """A function that changes the lines of a file of the whole folder, until the test ends."""
    before = {}

    def edit(name, edit_lines):
        path = whole / name
        before[path] = path.read_bytes()
        lines = before[path].decode().splitlines()
        path.write_text("\n".join(edit_lines(lines)) + "\n")
        return path

    yield edit
    for path, content in before.items():
        path.write_bytes(content)


def line(number, text):
    """An edit: line `number` says `text`."""
    return lambda lines: [*lines[: number - 1], text, *lines[number:]]


def number(line_number, place, text):
    """An edit: one number of a line."""

    def edit(lines):
        row = lines[line_number - 1].split()
        row[place] = text
        return line(line_number, " ".join(row))(lines)

    return edit


@pytest.mark.slow
def test_the_whole_folder_is_read_in_the_order_of_our_recording(whole):
    samples = load_samples(whole)
    np.testing.assert_array_equal(samples.pattern, np.repeat(np.arange(144), 2))
    np.testing.assert_array_equal(samples.variation, np.tile([0, 1], 144))
    assert samples.joints.shape == (288, 100, 5) and samples.features.shape == (288, 100, 30)
    assert samples.joints.dtype == samples.features.dtype == np.float32
    for i in (0, 5, 150, 287):  # slow and fast, of both parts
        p, variation = patterns()[samples.pattern[i]], int(samples.variation[i])
        assert samples.frames[i] == p.frames
        np.testing.assert_allclose(
            samples.joints[i, : p.frames], joints_of(p, variation), atol=1e-6
        )
        features = samples.features[i, : p.frames]
        np.testing.assert_allclose(features, features_of(p, variation), atol=1e-5)
        assert not samples.joints[i, p.frames :].any() and not samples.features[i, p.frames :].any()
    assert samples.encoder == "authors"
    assert samples.cubes is samples.touched is samples.holdout is None


def test_the_whole_folder_has_the_papers_split(whole):
    samples = load_authors(whole)
    sizes = {name: len(samples.split(name)) for name in splits.SPLITS}
    assert sizes == {"train": 216, "test": 72, "held_out": 32, "fit": 184}
    assert {patterns()[i].split for i in samples.pattern[samples.split("test")]} == {"test"}


def test_the_training_part_alone_needs_a_holdout(training_part):
    with pytest.raises(RecordingError, match="has no test part .* with --holdout N"):
        load_samples(training_part)
    samples = load_samples(training_part, holdout=12)
    assert len(samples.joints) == 216 and samples.holdout == 12
    aside = samples.pattern[samples.split("test")]
    assert len(aside) == 24 and set(aside) == set(splits.holdout_patterns(12))
    rest = {name: set(samples.split(name)) for name in ("train", "fit", "held_out")}
    assert rest["train"] == set(range(216)) - set(samples.split("test"))
    assert rest["fit"] | rest["held_out"] == rest["train"]
    assert not rest["fit"] & rest["held_out"]


@pytest.mark.parametrize("data", ["whole", "recording"])
def test_data_with_a_test_part_take_no_holdout(whole, data):
    with pytest.raises(ConfigError, match="leave --holdout out"):
        load_samples(whole if data == "whole" else data, holdout=3)


@pytest.mark.parametrize("count", [0, -1, 37])
def test_a_wrong_number_of_held_out_patterns_is_refused(training_part, count):
    with pytest.raises(ConfigError, match=f"^{count} held-out patterns: it is 1 to 36"):
        load_samples(training_part, holdout=count)


def test_an_unknown_split_is_refused(training_part):
    with pytest.raises(ConfigError, match="no split 'dev'; there are train, test"):
        load_samples(training_part, holdout=1).split("dev")


def test_held_out_patterns_are_a_balanced_part_of_the_training_patterns():
    for count in range(1, 37):
        chosen = splits.holdout_patterns(count)
        assert len(set(chosen)) == count
        assert set(chosen) <= set(splits.SPLITS["fit"])  # so not in `held_out`, and not in `test`
        assert set(splits.holdout_patterns(max(count - 1, 1))) <= set(chosen)
        meanings = {patterns()[i].meaning for i in chosen}
        assert len(meanings) == count
        left = splits.patterns_of("fit", count)
        assert {patterns()[i].meaning for i in left} == set(MEANINGS)
    for count, share in ((6, 1), (12, 2), (36, 6)):
        of = [patterns()[i] for i in splits.holdout_patterns(count)]
        assert all([p.target_colour for p in of].count(c) == share for c in COLOURS)
        assert [p.action for p in of].count("slide") == 2 * share
        assert [p.speed for p in of].count("fast") == 3 * share
        assert 0.3 <= [p.side for p in of].count("left") / count <= 0.7


JOINTS = "target/behavior_train/201207/target000000.txt"  # slow
FAST_JOINTS = "target/behavior_train/201223/target000072.txt"
TEST_JOINTS = "target/behavior_test/201223/target000002.txt"
VISION = "target/vision_train/201223/target000073.txt"  # fast
LANGUAGE = "target/language_train/201207/target000001.txt"  # pull red slowly
ZEROS, ONE = "0 " * 23, "1 " + "0 " * 22
RED_TWICE = " ".join("1" if i in (16, 17) else "0" for i in range(23))
BLUE = " ".join("1" if i == 3 else "0" for i in range(23))

WRONG = {
    "a joint over 1": (JOINTS, number(7, 2, "1.000100"), 7, "joint 3 is 1.0001, not in 0 to 1"),
    "a joint below 0": (FAST_JOINTS, number(50, 4, "-0.01"), 50, "joint 5 is -0.01, not in"),
    "a joint that is nan": (JOINTS, number(1, 0, "nan"), 1, "joint 1 is nan, not in 0 to 1"),
    "in the test part": (TEST_JOINTS, number(3, 1, "2"), 3, "joint 2 is 2, not in 0 to 1"),
    "a feature that is nan": (VISION, number(9, 29, "nan"), 9, "feature 30 is nan, not finite"),
    "an infinite feature": (VISION, number(9, 0, "-inf"), 9, "feature 1 is -inf, not finite"),
    "a feature out of float": (VISION, number(9, 0, "1e99"), 9, "feature 1 is inf, not finite"),
    "no number": (VISION, number(4, 3, "0.1.2"), 4, "to float: '0.1.2'"),
    "a number too few": (JOINTS, line(5, "0.1 0.2 0.3 0.4"), 5, "has 4 numbers, not 5"),
    "a number too many": (VISION, line(5, "0 " * 31), 5, "has 31 numbers, not 30"),
    "an empty line": (JOINTS, line(5, ""), 5, "has 0 numbers, not 5"),
    "no line": (JOINTS, lambda lines: [], 1, "has 0 numbers, not 5"),
    "a frame too few": (
        VISION, lambda lines: lines[:-1], 50,
        "the file has 49 lines, but a clip of pattern 73 (fast) has 50",
    ),
    "a frame too many": (
        JOINTS, lambda lines: [*lines, lines[0]], 101,
        "the file has 101 lines, but a clip of pattern 0 (slowly) has 100",
    ),
    "a slow clip's length": (FAST_JOINTS, lambda lines: lines * 2, 51, "has 100 lines, but"),
    "a language row too few": (
        LANGUAGE, lambda lines: lines[:-1], 40, "has 39 lines, but a language file has 40",
    ),
    "a language row too narrow": (LANGUAGE, line(2, "1 0"), 2, "has 2 numbers, not 23"),
    "two words at once": (LANGUAGE, line(8, RED_TWICE), 8, "is not one-hot"),
    "no word": (LANGUAGE, line(8, ZEROS), 8, "is not one-hot"),
    "half a word": (LANGUAGE, line(8, BLUE.replace("1", "0.5")), 8, "is not one-hot"),
    "a sum of one": (LANGUAGE, line(8, "0.5 0.5 " + "0 " * 21), 8, "is not one-hot"),
    "another colour": (
        LANGUAGE, line(8, BLUE), 8,
        "sentence 1 of pattern 1 reads 'move-down blue slowly', not 'move-down red slowly'",
    ),
    "an end too early": (
        LANGUAGE, line(4, ONE), 4, "sentence 0 of pattern 1 reads 'pull red', not 'pull red slowly'"
    ),
    "sentences in another order": (
        LANGUAGE, lambda lines: [*lines[5:10], *lines[:5], *lines[10:]], 2,
        "reads 'move-down red slowly', not 'pull red slowly'",
    ),
    "another action": ("actions.txt", line(1, "PULL-L-SLOW train"), 1, "not 'PUSH-L-SLOW train'"),
    "another split": ("actions.txt", line(3, "SLIDE-L-SLOW train"), 3, "not 'SLIDE-L-SLOW test'"),
    "another arrangement": ("arrangements.txt", line(144, "red+blue"), 144, "not 'cyan+violet'"),
    "another description": (
        "descriptions.txt", line(145, "push red slowly"), 145, "not 'move-up red slowly'",
    ),
    "a pattern too few": ("actions.txt", lambda lines: lines[:-1], 144, "143 lines, not 144"),
    "a pattern too many": (
        "arrangements.txt", lambda lines: [*lines, "red+blue"], 145, "145 lines, not 144",
    ),
    "another word": ("vocabulary.txt", line(17, "crimson"), 17, "says 'crimson', not 'red'"),
}  # fmt: skip


@pytest.mark.parametrize("what", WRONG)
def test_a_wrong_file_is_named_with_its_line(whole, change, what):
    name, edit, at, message = WRONG[what]
    path = change(name, edit)
    with pytest.raises(RecordingError) as refused:
        load_samples(whole)
    said = str(refused.value)
    assert said.startswith(f"{path}, line {at}: ") and message in said
    assert "\n" not in said


def test_bytes_that_are_no_text_are_refused(whole, change):
    path = change(VISION, lambda lines: lines)
    path.write_bytes(b"\xff\x00")
    with pytest.raises(RecordingError, match="target000073.txt is no readable text file"):
        load_samples(whole)


def test_a_vocabulary_may_be_left_out(whole, change):
    change("vocabulary.txt", lambda lines: lines).unlink()
    assert len(load_samples(whole).joints) == 288


@pytest.mark.parametrize("name", [JOINTS, TEST_JOINTS, VISION, LANGUAGE, "actions.txt"])
def test_a_missing_file_is_named(whole, change, name):
    path = change(name, lambda lines: lines)
    path.unlink()
    with pytest.raises(RecordingError) as refused:
        load_samples(whole)
    assert str(refused.value).startswith(f"{path} is missing; ")


@pytest.mark.parametrize("stream", ["vision_train", "language_test"])
def test_a_missing_folder_is_named_by_its_first_file(whole, tmp_path, stream):
    shutil.move(whole / "target" / stream, tmp_path)
    try:
        with pytest.raises(RecordingError, match=f"{stream}/201207/target00000[02].txt is missing"):
            load_samples(whole)
    finally:
        shutil.move(tmp_path / stream, whole / "target")


def test_a_missing_recording_is_noticed(whole, monkeypatch):
    monkeypatch.setattr(authors, "RECORDINGS", (*RECORDINGS, "210107"))
    with pytest.raises(RecordingError, match="behavior_train/210107/target000000.txt is missing"):
        load_samples(whole)


def test_a_test_pattern_among_the_training_files_is_refused(training_part):
    path = training_part / "target/vision_train/201223/target000002.txt"
    path.write_text("")
    try:
        with pytest.raises(RecordingError, match="target000002.txt belongs to no pattern of the t"):
            load_samples(training_part, holdout=3)
    finally:
        path.unlink()


def test_their_joints_have_a_range_of_one(whole):
    """So NRMSE there is the plain error: 0.1 everywhere is 10 % of the valid steps."""
    samples = load_samples(whole)
    train, test = samples.split("train"), samples.split("test")
    samples.joints[train[0], :2] = [[0] * 5, [1] * 5]
    scaling = fit_scaling(samples, train)
    np.testing.assert_array_equal(scaling.joint_range, np.ones(5))
    moved = samples.joints[test][:, 1:].astype(float) + 0.1
    assert nrmse(moved, samples, test, scaling)[1] == pytest.approx(10)


def test_their_features_are_whitened_as_ours_unless_the_recipe_says_otherwise(training_part):
    theirs = load_samples(training_part, holdout=3)
    for recipe in (training.Recipe(epochs=1, batch=100), training.Recipe(1, 100, exponent=0.0)):
        made = training.train(theirs, recipe, config=SMALL)
        wanted = fit_scaling(theirs, theirs.split("train"), recipe.exponent)
        np.testing.assert_array_equal(made.scaling.feature_map, wanted.feature_map)
    assert training.Recipe().exponent == HALF_WHITE


@pytest.mark.slow
def test_a_model_is_not_scored_on_patterns_it_was_trained_on(training_part, whole):
    one, two = (load_samples(training_part, holdout=n) for n in (1, 2))
    recipe = training.Recipe(epochs=1, batch=100)
    made = training.train(one, recipe, config=SMALL)
    made.dataset(one)
    made.dataset(replace(one, holdout=None))  # the paper's test set: never trained on
    with pytest.raises(ConfigError, match="2 patterns are held out, .* trained with 1 held out"):
        made.dataset(two)
    full = training.train(load_samples(whole), recipe, config=SMALL)
    with pytest.raises(ConfigError, match="trained with none held out"):
        full.dataset(one)


@pytest.fixture
def command(capsys, monkeypatch):
    """A function: run a command with `--json`, of a small model in one epoch."""
    real = training.train

    def train(samples, recipe, *, config, **options):
        return real(samples, training.Recipe(epochs=1, batch=54), config=SMALL, **options)

    monkeypatch.setattr("ptae_lite.experiments.experiment.train", train)

    def run(*arguments):
        status = cli.main([*map(str, arguments), "--json"])
        out, err = capsys.readouterr()
        return json.loads(out) if status == 0 else err

    return run


@pytest.mark.slow
def test_train_and_evaluate_on_the_whole_folder(command, whole, tmp_path):
    path = tmp_path / "w.safetensors"
    assert command("train", "ptae", "--data", whole, "--out", path)["steps"] == 4
    scores = command("evaluate", path, "--data", whole)
    assert scores["execute_nrmse_valid"] > 0 and "test_part" not in scores
    about = checkpoint.load(path).about
    assert (about["encoder"], about["holdout"]) == ("authors", None)


def test_train_and_evaluate_on_the_training_part(command, training_part, tmp_path):
    path, data = tmp_path / "w.safetensors", ("--data", training_part)
    made = command("train", "ptae", *data, "--holdout", 6, "--held-out", "--out", path)
    scores = command("evaluate", path, *data, "--holdout", 6)
    for found in (made, scores):
        assert found["test_part"] == "6 held-out training patterns, not the paper's test set"
        assert found["describe_accuracy"] >= 0
    assert checkpoint.load(path).about["holdout"] == 6


def test_the_study_of_few_labels_reads_the_folder(command, training_part, tmp_path):
    data = ("--data", training_part, "--holdout", 6)
    choice = ("--shares", 50, "--variants", "random", "--models", "linear", "--workers", 1)
    made = command("study", "supervision", *data, *choice, "--out", tmp_path)
    assert made["test_part"] == "6 held-out training patterns, not the paper's test set"
    table = pd.read_csv(tmp_path / "supervision.csv")
    assert len(table) == made["rows"] == 20 and set(table["data"]) == {"authors, 6 held out"}
    assert table["describe_accuracy"].notna().all() and table["describe_accuracy"].nunique() > 1


@pytest.mark.slow
def test_from_the_shell_a_refusal_says_what_to_do(command, training_part, tmp_path):
    path, data = tmp_path / "w.safetensors", ("--data", training_part)
    assert "with --holdout N" in command("train", "ptae", *data, "--out", path)
    assert "1 to 36" in command("train", "ptae", *data, "--holdout", 0, "--out", path)
    assert not path.exists()
    command("train", "ptae", *data, "--holdout", 6, "--out", path)
    assert "with --holdout N" in command("evaluate", path, *data)
    assert "may have seen them" in command("evaluate", path, *data, "--holdout", 12)
    assert "features of the CAE authors" in command("evaluate", path)
