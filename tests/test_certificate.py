"""A certificate holds where it was made, and tells what was changed, copied or of elsewhere."""

import json
from types import SimpleNamespace

import pytest

from ptae_lite import artefacts
from ptae_lite.errors import ArtefactError
from ptae_lite.reproduce import certificate, fingerprints

NAME = "Ada Müller"
FIXED = {"scores": {"describe_accuracy": 99.537, "execute_nrmse": 1.704}}


@pytest.fixture
def quick(monkeypatch):
    """The model is asked for the clips of a name alone, not for all test clips."""
    monkeypatch.setattr(certificate, "evaluate", lambda *_: dict(FIXED["scores"]))


@pytest.fixture
def times():
    return {name: {"seconds": 1.5, "traceback": ""} for name in fingerprints.chapters()}


@pytest.fixture
def body(quick, times):
    return certificate.make(NAME, times)


def state(lines):
    return {line.what: line.good for line in lines}


def test_a_name_picks_its_own_clips_from_the_test_set(samples):
    test = samples.split("test")
    mine, again, other = (certificate.asked(name, test) for name in (NAME, f" {NAME} ", "Bo"))
    assert list(mine) == list(again) != list(other)
    assert len(set(mine)) == certificate.ASKED and set(mine) <= set(test)


def test_what_is_made_here_holds_here(body, tmp_path, capsys):
    path = tmp_path / "c.json"
    path.write_text(json.dumps(body), "utf-8")
    lines = certificate.check(certificate.read(path))
    assert all(state(lines).values())
    assert certificate.show(body, lines) == 0
    out = capsys.readouterr().out
    assert "12 of 12 as the model here, asked for 'Ada Müller'" in out
    assert "The certificate holds." in out
    assert path.stat().st_size < 10_000


def test_another_name_on_a_copied_file_does_not_hold(body):
    body["name"] = "Bo"
    body["seal"] = certificate.seal(body)  # somebody who knows how to mend the seal
    found = state(certificate.check(body))
    assert not found["answers"] and found["seal"]


def test_a_number_changed_by_hand_breaks_the_seal(body):
    body["scores"]["execute_nrmse"] = 1.6
    found = state(certificate.check(body))
    assert not found["seal"] and found["scores"]


def test_better_scores_than_the_model_has_do_not_hold(body):
    body["scores"]["describe_accuracy"] = 88.0
    body["seal"] = certificate.seal(body)
    assert not state(certificate.check(body))["scores"]


def test_other_data_library_or_pins_are_named(body, capsys):
    body |= {"library": "x", "environment": "y"}
    body["data"]["recording/samples.npz"] = "z"
    lines = certificate.check(body)
    found = state(lines)
    assert not (found["library"] or found["packages"] or found["data"])
    assert certificate.show(body, lines) == 1
    assert "recording/samples.npz" in capsys.readouterr().out


def test_a_chapter_that_failed_or_is_not_there_is_named(quick, times):
    times["02_vision"]["traceback"] = "Traceback\n  /home/me/x.py\nZeroDivisionError: of /home/me"
    del times["03_crossmodal_transformer"]
    body = certificate.make(NAME, times)
    assert not body["verdicts"]["every chapter ran"]
    (line,) = (one for one in certificate.check(body) if one.what == "chapters")
    assert line.says == (
        "did not run: 02_vision (ZeroDivisionError), 03_crossmodal_transformer"
    ) and not line.good  # fmt: skip


def test_a_failed_run_is_no_more_accepted_by_the_teacher_than_by_who_made_it(quick, times):
    times["08_of_mine"] = {"seconds": 1.0, "traceback": "KeyError: 'x'"}
    body = certificate.make(NAME, times)
    assert not body["verdicts"]["every chapter ran"]
    (line,) = (one for one in certificate.check(body) if one.what == "chapters")
    assert "08_of_mine (KeyError)" in line.says and not line.good
    assert "/home" not in json.dumps(body)


@pytest.mark.slow
def test_two_certificates_of_one_run_are_recognised(quick, times, tmp_path, capsys):
    other = times | {"02_vision": {"seconds": 1.6, "traceback": ""}}
    files = []
    for name, run in (("Ada", times), ("Bo", times), ("Cy", other)):
        files.append(str(tmp_path / f"{name}.json"))
        (tmp_path / f"{name}.json").write_text(json.dumps(certificate.make(name, run)))
    assert certificate.main(["--check", *files]) == 0
    (line,) = (one for one in capsys.readouterr().out.splitlines() if "the one run of" in one)
    assert "Ada" in line and "Bo" in line and "Cy" not in line
    assert certificate.main(["--check", files[0], files[2]]) == 0
    assert "the one run of" not in capsys.readouterr().out


def test_a_chapter_that_was_edited_is_a_remark_only(body, capsys):
    body["sources"]["02_vision"] = "edited"
    body["seal"] = certificate.seal(body)
    assert certificate.show(body, certificate.check(body)) == 0
    assert "remark   sources   changed: 02_vision" in capsys.readouterr().out


def test_with_a_damaged_file_nothing_is_asked_and_that_is_said(quick, times, monkeypatch):
    hashes = certificate.stored_hashes()
    monkeypatch.setattr(certificate, "stored_hashes", lambda: hashes | {certificate.MODEL: "0"})
    monkeypatch.setattr(certificate, "ask", lambda name: 1 / 0)
    body = certificate.make(NAME, times)
    assert body["verdicts"] == {"every chapter ran": True, "every stored file is whole": False}
    assert body["answers"] == []


@pytest.mark.parametrize(
    "text", ["", "[]", '{"format": "something"}', "[" * 50_000, "x" * 200_000, "\udc80"]
)
def test_what_is_no_certificate_is_refused(tmp_path, text):
    path = tmp_path / "c.json"
    path.write_text(text, "utf-8", errors="surrogateescape")
    with pytest.raises(ArtefactError, match="is no certificate of ours; one is made by"):
        certificate.read(path)


def test_a_certificate_without_one_of_its_parts_is_refused(body, tmp_path):
    path = tmp_path / "c.json"
    for field in certificate.FIELDS:
        path.write_text(json.dumps({k: v for k, v in body.items() if k != field}))
        with pytest.raises(ArtefactError, match=f"lacks '{field}'"):
            certificate.read(path)
    with pytest.raises(ArtefactError, match="none.json is missing; name the file"):
        certificate.read(tmp_path / "none.json")


def test_the_command_runs_the_chapters_as_they_are_stored(quick, times, tmp_path, monkeypatch):
    """Unless it is told of a run, or only checks; a book that fails leaves no earlier run's."""
    ran, file = [], tmp_path / "build" / "chapter_times.json"

    def book(command, **_):
        ran.append(command[1:])
        assert not file.exists()
        file.write_text(json.dumps(times))

    file.parent.mkdir()
    file.write_text("{}")
    monkeypatch.setenv("PTAE_DATA", str(artefacts.data_folder()))
    monkeypatch.setattr(artefacts, "ROOT", tmp_path)
    monkeypatch.setattr(certificate, "subprocess", SimpleNamespace(run=book))
    out = str(tmp_path / "c.json")
    assert certificate.main(["--name", NAME, "--out", out]) == 0
    assert ran == [["-m", "ptae_lite.book.site", "--tier", "replay"]]
    assert certificate.main(["--name", NAME, "--out", out, "--times", str(file)]) == 0
    assert certificate.main(["--check", out]) == 0
    assert len(ran) == 1


def test_the_command_writes_and_checks_one_file(quick, times, tmp_path, capsys):
    path, chapters = tmp_path / "new" / "c.json", tmp_path / "times.json"
    chapters.write_text(json.dumps(times))
    made = ["--name", NAME, "--out", str(path), "--times", str(chapters)]
    assert certificate.main(made) == 0
    assert "good     every chapter ran" in capsys.readouterr().out
    times["05_incongruence"]["traceback"] = "MemoryError"
    chapters.write_text(json.dumps(times))
    assert certificate.main([*made[:2], "--out", str(tmp_path / "no.json"), *made[4:]]) == 1
    assert "did not run: 05_incongruence (MemoryError)" in capsys.readouterr().out
    assert certificate.main(["--check", str(path)]) == 0
    assert certificate.main(["--check", str(artefacts.data_folder() / "MANIFEST.json")]) == 1
    assert "certify: " in capsys.readouterr().err
