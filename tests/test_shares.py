"""Results by the share of labels: what is drawn and said is what the tables hold."""

import re
from itertools import product

import numpy as np
import pandas as pd
import pytest
from test_panels import controls_of, frames_in

from ptae_lite import artefacts
from ptae_lite.data.samples import load_samples
from ptae_lite.evaluation import CHANCE
from ptae_lite.experiments import supervision, supervision_grid
from ptae_lite.models import checkpoint
from ptae_lite.paper import reported
from ptae_lite.plots import supervision as supervision_plots
from ptae_lite.widgets import supervision as supervision_panel

SHARES = (2, 10, 66.6, 100)
KEY = supervision.KEY


def made(model, mode, variant, share, seed, accuracy, error):
    key = [model, "recording", mode, variant, share, seed]
    scores = {"describe_accuracy": accuracy, "execute_nrmse": error}
    return dict(zip(KEY, key, strict=True)) | scores | {"supervised_samples_seen": 1000 + seed}


@pytest.fixture(scope="module")
def table():
    """PTAE has one seed at 2 and 66.6 % and three at 10; PGAE only its regular training."""
    rows = [
        made("ptae", "samples", "paper", 2, 0, 20, 9), *(
            made("ptae", "samples", "paper", 10, seed, 50 + 10 * seed, 5) for seed in range(3)
        ),
        made("ptae", "samples", "paper", 66.6, 0, 95, 3),
        made("ptae", "samples", "balanced", 10, 0, 1, 1),  # another variant, not in these figures
        made("linear", "samples", "random", 2, 0, 10, np.nan),
        made("linear", "samples", "random", 2, 1, 30, np.nan),
        *(made(m, *other, 0, 99, 2) for m in ("ptae", "pgae")
          for other in (("samples", "paper", 100), ("iterations", "paper", 66.6))),
    ]  # fmt: skip
    return pd.DataFrame(rows).sample(frac=1, random_state=0)


@pytest.fixture(scope="module")
def said(table):
    answers = (
        ("push red slowly", "move-up scarlet fast", False), ("pull blue fast", np.nan, False),
        ("slide red fast", "slide red quickly", True),
    )  # fmt: skip
    return pd.DataFrame([
        {name: row[name] for name in KEY} | {"truth": truth, "said": words, "right": right}
        for row in table[table["model"] != "linear"].to_dict("records")
        for truth, words, right in answers
    ])  # fmt: skip


@pytest.fixture(scope="module")
def stored():
    names = ("supervision.csv", "supervision_sentences.csv")
    found = (pd.read_csv(artefacts.stored(f"results/{name}")) for name in names)
    return [table[table["data"] == "recording"] for table in found]


def curve(axes, label):
    """Means of a model by share, and how far its bars reach down and up."""
    (found,) = [c for c in axes.containers if c.get_label() == label]
    line, _, (bars,) = found
    ends = [segment[:, 1] for segment in bars.get_segments() if len(segment)]
    return dict(zip(*map(list, line.get_data()), strict=True)), ends


def points(axes, label, colour=None):
    named = [one for one in axes.lines if one.get_label() == label]
    (found,) = [one for one in named if colour in (None, one.get_color())]
    return dict(zip(*map(list, found.get_data()), strict=True))


def test_a_point_is_the_mean_and_a_bar_reaches_to_the_worst_and_best_seed(table):
    _, accuracy, error = supervision_plots.by_share(table).axes
    means, ends = curve(accuracy, "PTAE")
    assert means == {2: 20, 10: 60, 66.6: 95, 100: 99}
    drawn = [end.tolist() for end in ends if np.isfinite(end).all()]
    assert drawn == [[50, 70]]  # one seed has no bar
    assert curve(error, "PTAE")[0] == {2: 9, 10: 5, 66.6: 3, 100: 2}
    assert curve(accuracy, "linear baseline")[0] == {2: 20}
    assert "linear baseline" not in [c.get_label() for c in error.containers]
    by_iterations = supervision_plots.by_share(table).axes[
        0
    ]  # where the table has no sums of all labels
    assert "linear baseline" not in [line.get_label() for line in by_iterations.lines]
    assert set(points(accuracy, "chance").values()) == {CHANCE}


def test_by_iterations_the_sums_have_all_labels(table):
    sums = table[(table["model"] == "linear")].head(1).assign(share=100, describe_accuracy=97.5)
    axis = supervision_plots.by_share(pd.concat([table, sums], ignore_index=True)).axes[0]
    assert set(points(axis, "linear baseline").values()) == {97.5}


def test_the_papers_numbers_stand_beside_ours(table):
    for axis, (column, mode) in zip(
        supervision_plots.by_share(table).axes, supervision_plots.PAPERS, strict=True
    ):
        for model in ("ptae", "pgae"):
            colour = supervision_plots.LOOKS[model][0]
            paper = {s: c.value for s, c in reported.BY_SHARE[model, column, mode].items()}
            assert points(axis, "the paper's text", colour) == paper


def test_a_training_stands_where_its_labels_were_shown(table):
    (axis,) = supervision_plots.by_samples_seen(table).axes
    labels = {line.get_label() for line in axis.lines}
    samples = {f"samples, {shown}" for shown in ("half of each batch", "once an epoch")}
    assert labels == samples | {"all labels", "chance"}
    assert {text.get_text() for text in axis.texts} == {"2", "10", "66.6"}


@pytest.mark.parametrize("share", SHARES)
def test_every_share_is_marked_with_its_sentences(table, said, share):
    card = supervision_panel.card(table, said, "samples", "ptae", share)
    rows = supervision_plots.rows_of(table, "ptae", "samples")
    rows = rows[rows["share"] == share]
    for axis, column in zip(card.figure.axes, supervision_plots.LABELS, strict=True):
        assert points(axis, "here") == {share: rows[column].mean()}
    cells = re.findall("<td[^>]*>(.*?)</td>", card._repr_html_())
    assert [re.sub("<[^>]*>", "", cell) for cell in cells] == [
        "wrong", "push red slowly", "move-up scarlet [fast]", "wrong", "pull blue fast",
        "[(nothing)]", "right", "slide red fast", "slide red quickly",
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("said", "right"),
    [("push red slowly", [1, 1, 1]), ("move-up scarlet fast", [1, 1, 0]), ("red push", [0, 0]),
     ("push red slowly slowly", [1, 1, 1, 0]), (np.nan, [0])],
)  # fmt: skip
def test_each_word_is_judged_at_its_place(said, right):
    assert [ok for _, ok in supervision_panel.marked("push red slowly", said)] == [
        bool(r) for r in right
    ]


def test_what_the_table_lacks_is_said_in_its_place(table, said):
    panel = supervision_panel.panel(table, said, model="PTAE", share=10)
    for model, there in (("PTAE", "2, 10, 66.6, 100 %"), ("PVAE", "none with this model")):
        where = {"mode": "samples", "model": model, "share": 50}
        lacking = f"The table has no {model} with 50 % of the samples; it has {there}."
        axes = panel.frame(**where).figure.axes
        assert f"<p>{lacking}</p>" in panel.face(**where)
        assert axes[0].containers and "here" not in [one.get_label() for one in axes[0].lines]


def without_figures(monkeypatch):
    """The panel's cards with a text in the place of the figure."""
    monkeypatch.setattr(supervision_panel, "as_html", lambda figure, text: text)
    monkeypatch.setattr(supervision_panel, "draw_measure", lambda *a: None)


def test_the_stored_panel_says_its_table_at_every_position(stored, monkeypatch):
    """With its texts in the place of its figures, which the tests around this one look at."""
    table, said = stored
    without_figures(monkeypatch)
    panel = supervision_panel.panel(table, said, share=10)
    frames, _ = frames_in(panel.html())
    assert len(frames) == np.prod([len(values) for values in panel.values.values()])
    for mode, model, share in product(*panel.values.values()):
        face = panel.face(mode=mode, model=model, share=share)
        assert face in frames
        rows = supervision_plots.rows_of(table, model.lower(), mode)
        rows = rows[rows["share"] == share]
        if rows.empty:
            assert face.startswith("The table has no ")
            continue
        assert f"right for {rows['describe_accuracy'].mean():.1f} % of the test" in face
        assert f"NRMSE of {rows['execute_nrmse'].mean():.2f} %" in face
        own = supervision_plots.rows_of(said, model.lower(), mode)
        own = own[(own["share"] == share) & (own["seed"] == rows["seed"].min())]
        assert len(own) == supervision.SHOWN
        words = re.sub("[\\[\\]]|<[^>]*>", "", face.replace("</td>", "|"))
        for row in own.fillna("(nothing)").itertuples():
            assert f"{'right' if row.right else 'wrong'}|{row.truth}|{row.said}|" in words


def test_the_stored_panel_shows_live_what_is_stored_of_it(stored):
    panel = supervision_panel.panel(*stored, mode="samples", model="PTAE", share=10)
    view, shown = panel.widget(), set()
    for model in ("PTAE", "PGAE", "PTAE"):
        controls_of(view)["model"].value = model
        assert view.children[-2].value == panel.face(mode="samples", model=model, share=10)
        shown.add(view.children[-2].value)
    assert len(shown) == 2


def test_the_button_trains_what_the_panel_shows(table, said, few, monkeypatch, trained):
    asked = []

    def fit(samples, job, recipe, progress):
        asked.append((job, recipe.epochs, [*progress(range(1, 3))]))
        return trained

    monkeypatch.setattr(supervision_panel, "fit", fit)
    box = supervision_panel.train_panel(few, table, said, epochs=2, model="PTAE", share=10).widget()
    mode, _, slider, *_ = box.children
    button, line, result = box.children[-3:]
    assert "2 epochs" in button.description and result.value == ""
    mode.value, slider.value = "iterations", 2
    button.click()
    ((job, epochs, told),) = asked
    assert job == supervision_grid.Job("ptae", "iterations", "paper", 2, 0)
    assert (epochs, told) == (2, [1, 2]) and not button.disabled
    assert "trained: 3 steps" in line.value and "<img" in result.value
    now = (pd.DataFrame([supervision.scores(trained, few)]), supervision.examples(trained, few))
    card = supervision_panel.card(table, said, "iterations", "ptae", 2, live=now)
    for axis, column in zip(card.figure.axes, supervision_plots.LABELS, strict=False):
        assert points(axis, "trained just now") == {2: now[0][column].iloc[0]}


def test_what_cannot_be_trained_is_said_and_an_error_is_shown(
    table, said, few, monkeypatch, caplog
):
    box = supervision_panel.train_panel(
        few, table, said, model="PVAE", mode="iterations", share=2
    ).widget()
    button, _, result = box.children[-3:]
    button.click()
    assert result.value.startswith("PVAE has no signals")
    monkeypatch.setattr(supervision_panel, "fit", lambda *a, **o: 1 / 0)
    button.click()
    assert 'role="alert"' in result.value and "ZeroDivisionError" in result.value
    assert "division by zero" in caplog.text and not button.disabled


def test_on_a_page_there_is_no_button(table, said, few, monkeypatch):
    monkeypatch.setenv("PTAE_STATIC", "1")
    without_figures(monkeypatch)
    bundle = supervision_panel.train_panel(few, table, said, share=10)._repr_mimebundle_()
    assert "button" not in bundle["text/html"] and "data-ptae-embed" in bundle["text/html"]


@pytest.mark.parametrize("share", [5, 20, 100])
def test_the_stored_weights_are_of_the_study_and_give_its_rows(stored, share):
    samples = load_samples("recording")
    job = supervision_grid.Job("ptae", "samples", "paper", share, 0)
    asked = supervision.experiment_of(samples, job)
    name = asked.file if share < 100 else "ptae.safetensors"
    trained = checkpoint.load(artefacts.stored(f"weights/{name}"))

    def own(rows):
        rows = rows.query("model == 'ptae' and data == 'recording' and mode == 'samples'")
        rows = rows[rows["variant"] == "paper"]
        return rows[(rows["share"] == share) & (rows["seed"] == 0)]

    row, said = (own(rows) for rows in stored)
    if share < 100:  # the others are older than the default of `balanced`, which they do not use
        assert trained.about["experiment"] == asked.hash
    assert trained.about["labelled"] == row["labelled"].item()
    for name, value in supervision.scores(trained, samples).items():
        one_sample = 0.5 if name.endswith("accuracy") else 0.02
        assert row[name].item() == pytest.approx(value, abs=one_sample), name
    again = supervision.examples(trained, samples)
    assert said["sample"].tolist() == again["sample"].tolist()
    assert (said["right"].to_numpy() != again["right"].to_numpy()).sum() <= 1
