"""A full re-run in small: what is finished is not done twice, and the report tells the truth."""

import io
import json
import re
import shutil
import threading
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from ptae_lite import artefacts, progress
from ptae_lite.cli import bar
from ptae_lite.errors import PTAEError
from ptae_lite.experiments import tables
from ptae_lite.files import file_lock
from ptae_lite.progress import share_in
from ptae_lite.reproduce import checks, pipeline, report, rerun, run_parallel
from ptae_lite.reproduce.checks import arrays, judge, near, pictures, table
from ptae_lite.reproduce.rerun import Rerun, Settings
from ptae_lite.reproduce.stages import OF_A_MACHINE, STAGES, Stage
from ptae_lite.reproduce.view import View, duration

CHECK = table(("model", "seed", "row"), {"accuracy": (0.5, 0)})
NAMES = ("results/one.csv", "results/two.csv")


def stage(name, **more):
    more = {"minutes": 0.1} | more
    return Stage(name, f"tiny make {{out}}/results/{name}.csv", {f"results/{name}.csv": CHECK},
                 **more)  # fmt: skip


@pytest.fixture
def tiny(monkeypatch):
    """The tiny jobs can be named as modules, and take no time."""
    import faults.tiny as module

    monkeypatch.setenv("PYTHONPATH", f"{Path(module.__file__).parent}:{artefacts.ROOT / 'src'}")
    return module


@pytest.fixture
def stored(tmp_path):
    """A data folder with the two tables that the tiny stages make."""
    folder = tmp_path / "stored"
    for number, name in enumerate(NAMES):
        rows = [{"model": "a", "seed": 0, "row": i, "accuracy": 90 + i} for i in range(4)]
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        pd.DataFrame(rows).to_csv(folder / name, index=False)
        artefacts.register(name, command="x", seed=0, minutes=number, data=folder)
    return folder


@pytest.fixture
def settings(tmp_path, stored):
    return Settings(tmp_path / "out", 1, "cpu", stored)


def test_every_stored_file_is_made_by_one_stage():
    made = [name for one in STAGES for name in one.makes]
    assert len(made) == len(set(made))
    lacking = set(artefacts.manifest()) - set(made) - OF_A_MACHINE
    assert not lacking, f"add to a stage in reproduce/stages.py, or add a stage: {sorted(lacking)}"


def test_every_stage_is_a_command_that_exists():
    from ptae_lite.__main__ import parser

    def written(seeds):
        return [one.arguments(out=Path("o"), seeds=range(seeds), device="cpu") for one in STAGES]

    for words in written(1) + written(2):
        own = words[1:] if words[0] == run_parallel.__name__ else words
        for module, *arguments in run_parallel.commands(own):
            if module == "ptae_lite":
                assert vars(parser().parse_args(arguments))["run"]
            else:
                __import__(module)
    labels = next(words for words in written(2) if "supervision" in words)
    assert " ".join(labels).count("--seeds 0 1 ") == 2  # of both its commands


def meet(me: str, other: str) -> str:
    """A module that ends well if it meets the other while both run."""
    return (
        "import pathlib, sys, time\n"
        f"pathlib.Path({me!r}).touch()\n"
        "for _ in range(600):\n"
        f"    if pathlib.Path({other!r}).exists(): sys.exit(0)\n"
        "    time.sleep(0.05)\n"
        "sys.exit(1)\n"
    )


def test_commands_run_beside_each_other(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for me, other in (("left", "right"), ("right", "left")):
        Path(f"{me}.py").write_text(meet(me, other))
    assert run_parallel.main(["left", "+", "right"]) == 0


def test_one_of_several_that_fails_is_a_failure_and_the_others_are_finished(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("slow.py").write_text(
        "import pathlib, time\ntime.sleep(1)\npathlib.Path('done').touch()\n"
    )
    Path("killed.py").write_text("import os, signal\nos.kill(os.getpid(), signal.SIGKILL)\n")
    assert run_parallel.main(["killed", "+", "slow"]) == 1
    assert Path("done").exists()


def test_eyes_are_taken_from_where_their_study_leaves_them():
    from ptae_lite.experiments import encoders
    from ptae_lite.experiments.encoder_training import folder_of

    (one,) = (one for one in STAGES if one.name == "encoders")
    for name, path in one.lies.items():
        kind, recipe = (artefacts.load_weights(artefacts.stored(name))[1][k]
                        for k in ("kind", "recipe"))  # fmt: skip
        (encoder,) = (e for e, (k, code) in encoders.CAES.items() if k == kind and code == 10)
        length = recipe["steps"] * recipe["batch"]
        assert path == f"encoders/{folder_of(encoder, recipe['seed'])}/encoder_{length}.safetensors"
        assert length in encoders.CHECKPOINTS[encoder]
    features = next(one for one in STAGES if one.name == "features").command
    assert features.endswith("--encoder {out}/" + one.lies["weights/cae.safetensors"])


def test_a_file_that_lies_elsewhere_is_kept_under_its_stored_name(tiny, settings):
    lies, check = {NAMES[0]: "results/other.csv"}, checks.texts(("row",), "model", 1)
    other = Stage("one", "tiny make {out}/results/other.csv", {NAMES[0]: check}, lies=lies)
    again = Rerun(settings, (other,))
    again.go(io.StringIO())
    made = settings.out / "results/other.csv"
    assert made.read_bytes() == (settings.data / NAMES[0]).read_bytes()
    assert [state for _, state in Rerun(settings, (other,)).plan()] == ["done"]
    assert report.rows(again)[0].verdict == report.AGREES


def test_a_made_table_that_was_changed_later_is_made_again(tiny, settings):
    Rerun(settings, (stage("one"),)).go(io.StringIO())
    (settings.out / NAMES[0]).write_text("model\n")
    assert [state for _, state in Rerun(settings, (stage("one"),)).plan()] == ["to do"]


def test_a_run_makes_everything_once_and_says_what_agreed(tiny, settings, capsys):
    stages, stream = (stage("one"), stage("two")), io.StringIO()
    assert Rerun(settings, stages).go(stream) is None
    assert "[2/2] two done" in stream.getvalue()
    again = Rerun(settings, stages)
    assert [state for _, state in again.plan()] == ["done", "done"]
    again.go(stream)
    assert (settings.out / "results/times_made.txt").read_text() == "one.csv\ntwo.csv\n"
    assert report.write(again) == 0
    assert "2 of 2 files agree. The report:" in capsys.readouterr().out
    text = (settings.out / "report.md").read_text()
    assert "| results/one.csv | agrees | the same bytes |" in text
    assert "`python -m tiny make" in text and str(settings.out) not in text
    entry = artefacts.entry_of(NAMES[0], settings.data)
    assert entry["command"].startswith("python -m tiny make")


@pytest.mark.slow
def test_a_file_that_was_lost_or_changed_is_made_again_and_no_other(tiny, settings):
    stages = (stage("one"), stage("two"))
    Rerun(settings, stages).go(io.StringIO())
    (settings.data / NAMES[0]).write_text("model\n")
    assert [state for _, state in Rerun(settings, stages).plan()] == ["to do", "done"]
    Rerun(settings, stages).go(io.StringIO())
    made = (settings.out / "results/times_made.txt").read_text().split()
    assert made == ["one.csv", "two.csv", "one.csv"]


def store(settings, name, change):
    """Put another table in place of a stored one."""
    path = settings.stored / name
    change(pd.read_csv(path)).to_csv(path, index=False)
    artefacts.register(name, command="x", seed=0, minutes=0, data=settings.stored)


def run_both(settings):
    again = Rerun(settings, (stage("one"), stage("two")))
    again.go(io.StringIO())
    return again


def test_what_differs_is_said_and_fails(tiny, settings, capsys):
    store(settings, NAMES[1], lambda table: table.assign(accuracy=table["accuracy"] + 3))
    assert report.write(run_both(settings)) == 1
    out = capsys.readouterr().out
    assert "DIFFERS      results/two.csv: 4 of 4 rows re-made, 0 of 4 numbers within; " in out
    assert "furthest: accuracy 90 for 93" in out
    found = json.loads((settings.out / "report.json").read_text())
    assert not found["good"] and [row["verdict"] for row in found["files"]] == ["agrees", "DIFFERS"]


def test_a_failed_stage_stops_the_run_and_the_report_names_what_is_missing(tiny, settings, capsys):
    stages = (stage("one"), Stage("two", "tiny failing", {NAMES[1]: CHECK}), stage("three"))
    again = Rerun(settings, stages)
    failed = again.go(io.StringIO())
    assert failed.name == "two" and "the last words" in again.last_words(failed)
    assert report.write(again, failed) == 1
    out = capsys.readouterr().out
    assert "NOT MADE     results/two.csv: its stage was not finished" in out
    assert not (settings.out / "results/three.csv").exists()


def test_a_table_of_which_a_part_was_made_again_agrees_in_part(tiny, settings, capsys):
    store(settings, NAMES[0], lambda table: pd.concat([table, table.assign(seed=1)]))
    assert report.write(run_both(settings)) == 0
    out = capsys.readouterr().out
    assert "in part      results/one.csv: 4 of 8 rows re-made, 4 of 4 numbers within" in out
    assert "; the other rows are the stored" in out and "1 of 2 files agree, 1 in part." in out


def test_a_table_is_completed_in_its_own_order():
    old = pd.DataFrame({"a": ["y", "x", "x"], "b": [None, None, "q"], "n": [1, 2, 3]})
    rows = pd.DataFrame({"a": ["x", "z"], "b": ["q", None], "n": [30, 40]})
    found = tables.completed(rows, old, ["a", "b"])
    assert found["a"].tolist() == ["y", "x", "x", "z"] and found["n"].tolist() == [1, 2, 30, 40]
    two = tables.completed(rows, old.assign(b=["q", None, None]), ["a", "b"])  # on two devices
    assert two["n"].tolist() == [1, 2, 3, 30, 40]


def test_the_book_of_a_rerun_has_all_rows_its_own_where_it_made_them(tiny, settings):
    def older(table):
        return pd.concat([table.assign(accuracy=50.0), table.assign(seed=1, accuracy=60.0)])

    store(settings, NAMES[0], older)
    run_both(settings)
    made, kept = (pd.read_csv(folder / NAMES[0]) for folder in (settings.out, settings.data))
    stored = pd.read_csv(settings.stored / NAMES[0])
    assert len(made) == 4 and len(kept) == len(stored) == 8
    assert kept[kept["seed"] == 0]["accuracy"].tolist() == made["accuracy"].tolist()
    assert (kept[kept["seed"] == 1]["accuracy"] == 60).all()


def test_a_stored_file_that_no_stage_makes_is_named(tiny, settings, capsys):
    again = Rerun(settings, (stage("one"),))
    again.go(io.StringIO())
    assert report.write(again) == 1
    assert "results/two.csv: no stage makes it" in capsys.readouterr().out


def test_times_of_a_machine_are_there_for_the_book(tiny, settings, capsys):
    (name,) = OF_A_MACHINE
    (settings.stored / name).write_text("measure,value\n")
    artefacts.register(name, command="x", seed=None, minutes=1, data=settings.stored)
    stages = (stage("one"), stage("two"))
    Rerun(settings, stages).go(io.StringIO())
    assert artefacts.stored(name, settings.data).read_text() == "measure,value\n"
    assert report.write(Rerun(settings, stages)) == 0
    assert name not in (settings.out / "report.md").read_text()


def test_without_a_simulator_its_files_are_taken_and_called_so(tiny, settings, capsys):
    stages = (stage("one", simulator=True), stage("two"), stage("new", simulator=True))
    again = Rerun(settings, stages, simulator=False)
    again.go(io.StringIO())
    assert (settings.data / NAMES[0]).read_bytes() == (settings.stored / NAMES[0]).read_bytes()
    assert artefacts.entry_of(NAMES[0], settings.data)["command"] == "x"
    assert [state for _, state in Rerun(settings, stages, simulator=False).plan()] == ["done"] * 3
    assert report.write(again) == 0
    out = capsys.readouterr().out
    assert "not re-made  results/one.csv: needs PyBullet, so it was taken" in out
    assert "not re-made  results/new.csv: needs PyBullet, and nothing is stored to take" in out
    assert (settings.out / "results/times_made.txt").read_text() == "two.csv\n"


def test_with_one_seed_nothing_is_compared_that_needs_several(tiny, settings, capsys):
    stages = (stage("one", least_seeds=2), stage("two"))
    again = Rerun(settings, stages)
    again.go(io.StringIO())
    assert report.write(again) == 0
    assert "results/one.csv: compares variants, which takes 2 seeds, so" in capsys.readouterr().out
    assert (settings.out / "results/times_made.txt").read_text() == "two.csv\n"
    more = Rerun(replace(settings, seeds=2), stages)
    assert [state for _, state in more.plan()] == ["to do", "done"]


def test_words_in_brackets_are_for_one_seed():
    short = Stage("a", "study [--few things] --seeds {seeds}", minutes=9, minutes_of_one=4)
    words = [" ".join(short.arguments(seeds=range(n))) for n in (1, 2)]
    assert words == ["study --few things --seeds 0", "study --seeds 0 1"]
    assert [short.estimate(n) for n in (1, 2)] == [4, 9]


def test_a_folder_of_something_else_is_refused_and_left_alone(settings):
    settings.out.mkdir()
    (settings.out / "mine.txt").write_text("mine")
    with pytest.raises(PTAEError, match="out holds something else; name a new or an empty folder"):
        Rerun(settings, ())
    assert [path.name for path in settings.out.iterdir()] == ["mine.txt"]


def test_a_run_of_another_version_of_the_library_is_not_gone_on_with(tiny, settings, monkeypatch):
    Rerun(settings, (stage("one"),)).go(io.StringIO())
    monkeypatch.setattr(rerun, "library", lambda: "another")
    with pytest.raises(PTAEError, match="begun with another version of the library"):
        Rerun(settings, (stage("one"),))


def test_a_damaged_record_of_what_is_done_is_refused(settings):
    settings.out.mkdir()
    (settings.out / "rerun.json").write_text('{"format": ')
    with pytest.raises(PTAEError, match="rerun.json is damaged; delete the folder"):
        Rerun(settings, ())


def test_the_plan_is_shown_without_doing_anything(tmp_path, capsys):
    out = tmp_path / "new"
    assert pipeline.main(["--plan", "--seeds", "1", "--out", str(out)]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) == len(STAGES) + 1 and not out.exists()
    assert re.match(r"to do +5 min  python -m ptae_lite record --out", lines[0])
    assert re.fullmatch(r"About \d h \d\d min to do, on two free cores.", lines[-1])


def test_a_full_run_into_the_data_folder_is_refused(capsys):
    assert pipeline.main(["--out", str(artefacts.data_folder() / "full")]) == 1
    assert (
        "data/ holds what the book is built on; write into build/full/" in capsys.readouterr().err
    )


def test_a_second_run_in_the_same_folder_is_refused(tmp_path, capsys):
    with file_lock(tmp_path / "out"):
        assert pipeline.main(["--out", str(tmp_path / "out")]) == 1
    message = f"full: another run is at work on {tmp_path / 'out'}; wait until it ends"
    assert message in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


# ---------------------------------------------------------------- comparing


def test_numbers_are_near_within_what_is_allowed():
    pairs = {"a": ([1.0, 2.0, np.nan], [1.1, 2.0, np.nan]), "b": ([10], [12])}
    says = "4 of 4 numbers within; furthest: b 10 for 12"
    assert near(pairs, {"a": (0.2, 0), "b": (0, 0.2)}) == (True, says, True)
    assert not near(pairs, {"a": (0.05, 0), "b": (0, 0.2)}).agrees
    assert near(pairs, {"a": (0.05, 0), "b": (0, 0.2)}, share=0.7).agrees
    assert not near({"a": ([np.nan], [1.0])}, {"a": (9, 9)}).agrees
    assert near({}, {}) == (False, "they have nothing in common to compare", True)


def two(tmp_path, name, write):
    """The same file name in two data folders, written by `write(path, first)`."""
    folders = [tmp_path / "remade", tmp_path / "stored"]
    for first, folder in zip((True, False), folders, strict=True):
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        write(folder / name, first)
        artefacts.register(name, command="x", seed=0, minutes=0, data=folder)
    return folders


def test_tables_are_compared_by_means_over_the_seeds_both_have(tmp_path):
    def write(path, first):
        rows = [("a", 0, 90.0, 5), ("a", 1, 80.0, 5), ("b", 0, 70.0, 5)]
        if first:  # seeds change places, one row is not there, a column that does not count differs
            rows = [("a", 0, 80.0, 9), ("a", 1, 90.0, 9)]
        pd.DataFrame(rows, columns=["model", "seed", "accuracy", "seconds"]).to_csv(
            path, index=False
        )

    folders = two(tmp_path, "t.csv", write)
    check = table(("model", "seed"), {"accuracy": (1, 0)})
    says = "2 of 3 rows re-made, 1 of 1 numbers within"
    assert judge("t.csv", check, *folders) == (True, says, False)
    assert check.states == "95% of its numbers: accuracy ± 1"
    other = table(("model", "split"), {"accuracy": (1, 0)})
    assert judge("t.csv", other, *folders) == (False, "has no column 'split'", True)


def test_a_table_without_a_column_does_not_agree(tmp_path):
    def write(path, first):
        pd.DataFrame({"model": ["a"], "good" if first else "accuracy": [1]}).to_csv(
            path, index=False
        )

    verdict = judge(
        "t.csv", table(("model",), {"accuracy": (9, 0)}), *two(tmp_path, "t.csv", write)
    )
    assert verdict == (False, "has no column 'accuracy'", True)


@pytest.mark.parametrize(
    ("change", "agrees"),
    [({"joints": 0.005}, True), ({"joints": 0.05}, False), ({"pattern": 1}, False)],
)
def test_arrays_are_compared_by_name(tmp_path, change, agrees):
    def write(path, first):
        made = {"joints": np.zeros((4, 5)), "pattern": np.arange(4)}
        np.savez(path, **{k: v + (change.get(k, 0) if first else 0) for k, v in made.items()})

    folders = two(tmp_path, "a.npz", write)
    assert judge("a.npz", arrays({"joints": 0.01}), *folders).agrees is agrees


@pytest.mark.parametrize(("light", "agrees"), [(5, True), (-100, False)])
def test_film_strips_are_compared_by_their_light(tmp_path, light, agrees):
    def write(path, first):
        noise = np.random.default_rng(first).integers(90, 110, (2, 5, 12, 16, 3))
        np.savez(path, videos=(noise + light * first).astype(np.uint8), texts=np.array(["a", "b"]))

    folders = two(tmp_path, "s.npz", write)
    assert judge("s.npz", checks.STRIPS, *folders).agrees is agrees
    np.savez(folders[0] / "s.npz", texts=np.array(["a", "b"]))
    assert not checks.STRIPS.compare("s.npz", *folders).agrees


def test_each_of_several_arrays_has_to_agree(tmp_path):
    def write(path, first):
        np.savez(path, joints=np.zeros(5) + first, videos=np.zeros(5000))

    verdict = judge(
        "a.npz", arrays({"joints": 0.1, "videos": 4}, 0.9), *two(tmp_path, "a.npz", write)
    )
    assert not verdict.agrees and verdict.says.startswith("0 of 5 numbers within; furthest: joints")


@pytest.mark.parametrize(("wrong", "agrees"), [(1, True), (3, False)])
def test_answers_are_compared_by_their_texts(tmp_path, wrong, agrees):
    def write(path, first):
        said = ["push red"] * 6
        said[:wrong] = ["slide blue" if first else "push red"] * wrong
        pd.DataFrame({"aspects": ["", *"abcde"], "answer": said}).to_csv(path, index=False)

    check, folders = checks.texts(("aspects",), "answer", 0.7), two(tmp_path, "t.csv", write)
    assert judge("t.csv", check, *folders) == (agrees, f"{6 - wrong} of 6 answers the same", True)
    lost = two(tmp_path / "other", "t.csv", lambda path, first: path.write_text(
        "aspects,answer\na,x\n" + "b,y\n" * first))  # fmt: skip
    assert judge("t.csv", check, *lost) == (False, "has other rows", True)


def test_every_table_and_every_array_is_compared_in_something():
    for one in STAGES:
        for name, check in one.makes.items():
            if name.endswith(".csv") or (name.endswith(".npz") and check is not checks.PROBED):
                assert check.compare(
                    name, artefacts.data_folder(), artefacts.data_folder()
                ).agrees, name


@pytest.mark.parametrize(("lost", "agrees"), [(2, True), (6, False)])
def test_episodes_are_compared_by_their_ends(tmp_path, lost, agrees):
    from ptae_lite.experiments import episodes

    name, kept = f"results/{episodes.EPISODES}", episodes.load()
    won = [i for i, one in enumerate(kept) if one.verdict.success]

    def write(path, first):
        changed = list(kept)
        for i in won[:lost] if first else ():  # the arm stays, and so does the cube
            one = kept[i]
            still = one.episode._replace(joints_rad=one.episode.joints_rad[:1].repeat(9, 0),
                                         cubes=one.episode.cubes[:1].repeat(9, 0))  # fmt: skip
            changed[i] = one._replace(episode=still)
        episodes.write(path, changed)

    verdict = judge(name, checks.episodes(1 - 4 / len(kept)), *two(tmp_path, name, write))
    assert verdict.agrees is agrees
    assert verdict.says == f"{len(kept) - lost} of {len(kept)} succeed or fail as they did"


def test_other_episodes_do_not_agree(tmp_path):
    from ptae_lite.experiments import episodes

    name, kept = f"results/{episodes.EPISODES}", episodes.load()
    folders = two(tmp_path, name, lambda path, first: episodes.write(path, kept[first:]))
    assert judge(name, checks.episodes(0), *folders) == (
        False, "holds other sentences or scenes", True,
    )  # fmt: skip


@pytest.mark.parametrize(("levels", "agrees"), [(1, True), (9, False)])
def test_pictures_are_compared_by_their_pixels(tmp_path, levels, agrees):
    import zipfile

    from PIL import Image

    def write(path, first):
        with zipfile.ZipFile(path, "w") as file:
            png = io.BytesIO()
            Image.new("RGB", (4, 4), (100 + levels * first,) * 3).save(png, "PNG")
            file.writestr("p000_v0_t00.png", png.getvalue())

    assert judge("z.zip", pictures(2), *two(tmp_path, "z.zip", write)).agrees is agrees


@pytest.mark.slow
def test_the_stored_eyes_and_features_agree_with_themselves_by_score():
    data = artefacts.data_folder()
    for one in STAGES:
        for name, check in one.makes.items():
            if check is checks.PROBED or "draws" in check.states:
                assert check.compare(name, data, data).agrees, name


@pytest.mark.parametrize(("accuracy", "agrees"), [(96.0, True), (93.0, False)])
def test_a_model_is_compared_by_its_scores(monkeypatch, accuracy, agrees):
    scores = iter([{"describe_accuracy": accuracy, "execute_nrmse": 1.9},
                   {"describe_accuracy": 99.5, "execute_nrmse": 1.7}])  # fmt: skip
    monkeypatch.setattr(checks, "evaluate", lambda *_: next(scores))
    data = artefacts.data_folder()
    assert checks.SCORES.compare("weights/ptae.safetensors", data, data).agrees is agrees


def test_an_eye_that_draws_worse_is_found(tmp_path):
    import torch

    from ptae_lite import vision

    def write(path, first):
        if not first:
            shutil.copyfile(artefacts.stored("weights/plain_cae.safetensors"), path)
            return
        encoder = vision.load_autoencoder(artefacts.stored("weights/plain_cae.safetensors"))
        with torch.no_grad():
            encoder.decoder[-2].bias += 0.5
        vision.save_autoencoder(path, encoder)

    folders = two(tmp_path, "weights/plain_cae.safetensors", write)
    verdict = judge("weights/plain_cae.safetensors", checks.reconstruction(0.25), *folders)
    assert not verdict.agrees and verdict.says.startswith("error of a pixel")


# ---------------------------------------------------------------- the view


def test_a_bar_tells_its_share(tmp_path, monkeypatch):
    assert share_in(tmp_path) is None
    monkeypatch.setenv(progress.FILE, str(tmp_path / "share"))
    seen = [share_in(tmp_path) for _ in bar(range(4), mininterval=0, miniters=1)]
    assert seen == [0, 0.25, 0.5, 0.75] and share_in(tmp_path) == 1
    monkeypatch.setenv(progress.FILE, str(tmp_path / "gone" / "share"))
    assert list(bar(range(4), mininterval=0)) == [0, 1, 2, 3]


def test_a_share_is_that_of_the_slowest_command_also_before_it_has_begun(tmp_path, monkeypatch):
    monkeypatch.setenv(progress.FILE, str(tmp_path / "share"))
    first, second = progress.environments(2)
    Path(first[progress.FILE]).write_text("0.9")
    assert share_in(tmp_path) == 0
    Path(second[progress.FILE]).write_text("0.45")
    (tmp_path / "other").write_text("")  # it is being written
    assert share_in(tmp_path) == 0.45


def test_a_slow_command_counts_also_while_it_writes(tmp_path, monkeypatch):
    monkeypatch.setenv(progress.FILE, str(tmp_path / "slow"))
    (tmp_path / "fast").write_text("1")
    progress.tell(0)
    shares = (0.5 * k / 3000 for k in range(3001))
    writer = threading.Thread(target=lambda: [progress.tell(share) for share in shares])
    writer.start()
    seen = []
    while writer.is_alive():
        seen.append(share_in(tmp_path))
    assert len(seen) > 100 and seen == sorted(seen) and seen[-1] <= 0.5


@pytest.mark.slow
def test_the_progress_of_commands_side_by_side_is_that_of_the_slower(tiny, settings, monkeypatch):
    shares = []
    monkeypatch.setattr(View, "tick", lambda view, share: shares.append(share))
    files = ("results/one.csv", "results/slow.csv")
    both = " + ".join(f"tiny counted {{out}}/{name}" for name in files)
    command = "ptae_lite.reproduce.run_parallel " + both
    one = Stage("both", command, {files[0]: CHECK}, 0.1)
    assert Rerun(settings, (one,)).go(io.StringIO()) is None
    told = [share for share in shares if share is not None]
    assert told == sorted(told) and told[-1] == 1
    assert set(told) <= {0, 0.25, 0.5, 0.75, 1}  # a busy machine may look too late for one
    assert any(0 < share < 1 for share in told)


def test_durations():
    assert [duration(m) for m in (0, 1.6, 59, 61, 391)] == [
        "1 min", "2 min", "59 min", "1 h 01 min", "6 h 31 min"
    ]  # fmt: skip


def test_time_left_follows_the_speed_of_this_machine():
    now = [0.0]
    view = View(["a", "b", "c"], [10, 20, 30], {}, io.StringIO(), clock=lambda: now[0])
    view.begin(0)
    assert view.minutes_left() == 60
    now[0] += 20 * 60  # ten planned minutes took twenty
    assert view.done() == 20
    view.begin(1)
    assert view.minutes_left() == 100
    now[0] += 10 * 60
    view.tick(0.5)  # half of it in ten minutes: the stage knows better than the plan
    assert view.minutes_left() == 10 + 60
    view.tick(0.2)  # a second part has begun: a share of what, nobody knows
    assert view.minutes_left() == 30 + 60
    view.tick(0.9)
    assert view.minutes_left() == 30 + 60
    view.begin(2)
    view.tick(0.5)
    assert view.minutes_left() == 0  # a new stage, at once half done


def test_a_terminal_gets_one_line_and_a_log_few():
    class Terminal(io.StringIO):
        def isatty(self):
            return True

    for stream, lines in ((Terminal(), 1), (io.StringIO(), 2)):
        view = View(["a"], [1], {}, stream)
        view.begin(0)
        for i in range(10):
            view.tick(i / 10)
        view.done()
        assert stream.getvalue().count("\n") == lines
