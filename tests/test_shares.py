"""Results by the share of labelled samples: what is drawn and said is what the tables hold."""

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import pytest
from test_panels import controls_of, frames_in

from ptae_lite import artefacts, dataset, published
from ptae_lite.display import shares
from ptae_lite.evaluation import CHANCE
from ptae_lite.models import checkpoint
from ptae_lite.studies import supervision

SHARES = (2, 10, 66.6, 100)


@pytest.fixture(autouse=True)
def closed():
    yield
    plt.close("all")


@pytest.fixture(scope="module")
def table():
    return pd.DataFrame({
        "share": SHARES, "seed": 0, "labelled": [13, 65, 432, 648],
        "describe_accuracy": [20.0, 60.0, 95.0, 99.0], "execute_nrmse": [9.0, 5.0, 3.0, 2.0],
    }).sample(frac=1, random_state=0)  # fmt: skip


@pytest.fixture(scope="module")
def said():
    return pd.concat(
        pd.DataFrame({
            "share": share, "seed": seed, "truth": ["push red slowly", "pull blue fast"],
            "said": ["push red slowly", np.nan], "right": [True, False],
        })
        for share in SHARES for seed in (0, 1)
    )  # fmt: skip


@pytest.fixture(scope="module")
def stored():
    names = ("supervision.csv", "supervision_sentences.csv")
    return [pd.read_csv(artefacts.stored(f"results/{name}")) for name in names]


def line(axes, label):
    (found,) = [one for one in axes.lines if one.get_label() == label]
    return np.array(found.get_xdata()), np.array(found.get_ydata())


def mark(axes):
    return tuple(float(value[0]) for value in line(axes, "here"))


def test_results_stand_beside_what_the_paper_states(table):
    accuracy, error = shares.by_share(table).axes
    x, y = line(accuracy, "ours, one seed")
    assert x.tolist() == list(SHARES) and y.tolist() == [20, 60, 95, 99]
    assert line(error, "ours, one seed")[1].tolist() == [9, 5, 3, 2]
    x, y = line(accuracy, "stated in the paper's text")
    paper = {share: claim.value for share, claim in published.DESCRIBE_BY_SAMPLES.items()}
    assert dict(zip(x, y, strict=True)) == paper
    assert set(line(accuracy, "chance")[1]) == {CHANCE}


def test_several_seeds_are_dots_about_their_mean(table):
    other = table.assign(seed=1, describe_accuracy=table["describe_accuracy"] - 10)
    accuracy, _ = shares.by_share(pd.concat([table, other])).axes
    assert line(accuracy, "ours, mean of 2 seeds")[1].tolist() == [15, 55, 90, 94]
    assert len(line(accuracy, "one seed")[0]) == 8


@pytest.mark.parametrize("share", SHARES)
def test_every_share_is_marked_with_its_sentences(table, said, share):
    figure = shares.card(table, said, share)
    row = table[table["share"] == share].iloc[0]
    assert mark(figure.axes[0]) == (share, row["describe_accuracy"])
    assert mark(figure.axes[1]) == (share, row["execute_nrmse"])
    texts = [text.get_text() for text in figure.axes[2].texts]
    assert texts[:2] == ["the clip shows", "the model says"]
    assert texts[2:] == [
        "push red slowly", "right   push red slowly", "pull blue fast", "WRONG   (nothing)",
    ]  # fmt: skip


def test_the_stored_panel_shows_and_says_its_table_at_every_position(stored):
    table, said = stored
    panel = shares.panel(table, said)
    frames, _ = frames_in(panel.html())
    view = panel.widget()
    (slider,) = controls_of(view).values()
    assert panel.values["share"] == sorted(table["share"].unique().tolist())
    assert len(set(frames)) == len(frames) == table["share"].nunique()
    for frame, share in zip(frames, panel.values["share"], strict=True):
        slider.value = share
        assert view.children[-1].value == frame  # live equals stored
        rows, text = table[table["share"] == share], panel.description(share=share)
        assert f"right for {rows['describe_accuracy'].mean():.1f} % of the test" in text
        assert f"NRMSE of {rows['execute_nrmse'].mean():.2f} %" in text
        assert f"({rows['labelled'].iloc[0]})" in text
        for row in said[(said["share"] == share) & (said["seed"] == 0)].itertuples():
            assert f"{row.truth}: {'right' if row.right else 'wrong'}, {row.said}" in text
        assert mark(panel.frame(share=share).axes[0])[1] == rows["describe_accuracy"].mean()


def test_the_stored_weights_still_give_the_row_of_all_labels(stored):
    """The row of 100 % is the model of chapter 03, whose weights are stored."""
    table, said = stored
    samples = dataset.load("recording")
    trained = checkpoint.load(artefacts.stored("weights/ptae.safetensors"))
    row = table[(table["share"] == 100) & (table["seed"] == 0)].iloc[0]
    for name, value in supervision.scores(trained, samples).items():
        one_sample = 0.5 if name.endswith("accuracy") else 0.02
        assert row[name] == pytest.approx(value, abs=one_sample), name
    kept = said[(said["share"] == 100) & (said["seed"] == 0)]
    again = supervision.examples(trained, samples, 100, 0)
    assert kept["sample"].tolist() == again["sample"].tolist()
    assert (kept["right"].to_numpy() != again["right"].to_numpy()).sum() <= 1
