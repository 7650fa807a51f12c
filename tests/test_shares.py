"""Results by the share of labels: what is drawn and said is what the tables hold."""

import numpy as np
import pandas as pd
import pytest
from test_panels import controls_of, frames_in

from ptae_lite import artefacts
from ptae_lite.data.samples import load_samples
from ptae_lite.evaluation import CHANCE
from ptae_lite.experiments import supervision
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
        made("ptae", "samples", "balanced", 2, 0, 20, 9), *(
            made("ptae", "samples", "balanced", 10, seed, 50 + 10 * seed, 5) for seed in range(3)
        ),
        made("ptae", "samples", "balanced", 66.6, 0, 95, 3),
        made("ptae", "samples", "paper", 10, 0, 1, 1),  # another variant, not in these figures
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
    return [pd.read_csv(artefacts.stored(f"results/{name}")) for name in names]


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
    assert labels == {"samples, balanced", "samples, paper", "all labels", "chance"}
    assert {text.get_text() for text in axis.texts} == {"2", "10", "66.6"}


@pytest.mark.parametrize("share", SHARES)
def test_every_share_is_marked_with_its_sentences(table, said, share):
    figure = supervision_panel.card(table, said, "samples", "ptae", share)
    rows = supervision_plots.rows_of(table, "ptae", "samples")
    rows = rows[rows["share"] == share]
    for axis, column in zip(figure.axes, supervision_plots.LABELS, strict=False):
        assert points(axis, "here") == {share: rows[column].mean()}
    texts = [text.get_text().strip() for text in figure.axes[2].texts]
    assert texts[:2] == ["the clip shows", "the model says ([ ]: a wrong word)"]
    assert texts[2:] == [
        "push red slowly", "WRONG", "move-up scarlet", "[fast]",
        "pull blue fast", "WRONG", "[(nothing)]", "slide red fast", "right", "slide red quickly",
    ]  # fmt: skip
    own, wrong = (t.get_text() for t in figure.axes[2].texts[4:6])
    assert wrong.index("[fast]") == own.index("move-up") + len("move-up scarlet ")


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
    panel = supervision_panel.panel(table, said, model="ptae", share=10)
    for model, there in (("ptae", "2, 10, 66.6, 100 %"), ("pvae", "none with this model")):
        where = {"mode": "samples", "model": model, "share": 50}
        lacking = f"The table has no {model.upper()} with 50 % of the samples; it has {there}."
        *axes, text = panel.frame(**where).axes
        assert panel.description(**where) == lacking == text.texts[0].get_text()
        assert axes[0].containers and "here" not in [one.get_label() for one in axes[0].lines]


def test_the_stored_panel_says_its_table_at_every_position(stored, monkeypatch):
    """With its texts in the place of its figures, which the tests around this one look at."""
    table, said = stored
    monkeypatch.setattr(supervision_panel, "card", supervision_panel.describe)
    panel = supervision_panel.panel(table, said, share=10)
    frames, _ = frames_in(panel.html())
    assert len(frames) == np.prod([len(values) for values in panel.values.values()])
    for mode in panel.values["mode"]:
        for model in panel.values["model"]:
            for share in panel.values["share"]:
                where = {"mode": mode, "model": model, "share": share}
                rows, text = (
                    supervision_plots.rows_of(table, model, mode),
                    panel.description(**where),
                )
                rows = rows[rows["share"] == share]
                if rows.empty:
                    assert text.startswith("The table has no ")
                    continue
                assert f"right for {rows['describe_accuracy'].mean():.1f} % of the test" in text
                assert f"NRMSE of {rows['execute_nrmse'].mean():.2f} %" in text
                own = supervision_plots.rows_of(said, model, mode)
                own = own[(own["share"] == share) & (own["seed"] == rows["seed"].min())]
                assert len(own) == supervision.SHOWN
                for row in own.fillna("(nothing)").itertuples():
                    assert f"{row.truth}: {'right' if row.right else 'wrong'}, {row.said}" in text
                assert panel.face(**where) in frames


def test_the_stored_panel_shows_live_what_is_stored_of_it(stored):
    panel = supervision_panel.panel(*stored, mode="samples", model="ptae", share=10)
    view, shown = panel.widget(), set()
    for model in ("ptae", "pgae", "ptae"):
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
    box = supervision_panel.train_panel(few, table, said, epochs=2, model="ptae", share=10).widget()
    mode, _, slider, *_ = box.children
    button, line, result = box.children[-3:]
    assert "2 epochs" in button.description and result.value == ""
    mode.value, slider.value = "iterations", 2
    button.click()
    ((job, epochs, told),) = asked
    assert job == supervision.Job("ptae", "iterations", "paper", 2, 0)
    assert (epochs, told) == (2, [1, 2]) and not button.disabled
    assert "trained: 3 steps" in line.value and "<img" in result.value
    now = (pd.DataFrame([supervision.scores(trained, few)]), supervision.examples(trained, few))
    figure = supervision_panel.card(table, said, "iterations", "ptae", 2, live=now)
    for axis, column in zip(figure.axes, supervision_plots.LABELS, strict=False):
        assert points(axis, "trained just now") == {2: now[0][column].iloc[0]}


def test_what_cannot_be_trained_is_said_and_an_error_is_shown(
    table, said, few, monkeypatch, caplog
):
    box = supervision_panel.train_panel(
        few, table, said, model="pvae", mode="iterations", share=2
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
    monkeypatch.setattr(supervision_panel, "card", supervision_panel.describe)  # no figures needed
    bundle = supervision_panel.train_panel(few, table, said, share=10)._repr_mimebundle_()
    assert "button" not in bundle["text/html"] and "data-ptae-embed" in bundle["text/html"]


def test_the_stored_weights_still_give_the_row_of_all_labels(stored):
    """The row of 100 % is the model of chapter 03, whose weights are stored."""
    table, said = stored
    samples = load_samples("recording")
    trained = checkpoint.load(artefacts.stored("weights/ptae.safetensors"))

    def own(rows):
        return rows[(rows["model"] == "ptae") & (rows["share"] == 100) & (rows["seed"] == 0)]

    for name, value in supervision.scores(trained, samples).items():
        one_sample = 0.5 if name.endswith("accuracy") else 0.02
        assert own(table)[name].item() == pytest.approx(value, abs=one_sample), name
    again = supervision.examples(trained, samples)
    assert own(said)["sample"].tolist() == again["sample"].tolist()
    assert (own(said)["right"].to_numpy() != again["right"].to_numpy()).sum() <= 1
