"""Reading the table of eyes: equal lengths, seeds and their spread, what has levelled off."""

import pandas as pd
import pytest

from ptae_lite.errors import ConfigError
from ptae_lite.experiments import encoders, encoders_table


def rows_of(*lengths, encoder="plain 10", seeds=(0,)):
    """Rows whose `lengths` are (presentations, pixel error, place, both first, both last)."""
    columns = ("samples_seen", "pixel_error", "first_place_mm", "first_both", "last_both")
    one = pd.DataFrame(lengths, columns=columns).assign(
        encoder=encoder, split="held_out", gflop=5000.0
    )
    one["device"] = "cpu"
    return pd.concat([one.assign(seed=seed) for seed in seeds], ignore_index=True)


def test_what_hardly_changes_when_doubled_has_levelled_off():
    table = rows_of((0, 1, 9, 0, 0), (100, 0.10, 3.0, 80, 60), (200, 0.095, 2.8, 82, 58))
    assert encoders_table.converged(table)["plain 10"].to_dict() == {200: True}
    changed = encoders_table.changes(table).loc["plain 10", 200]
    assert changed.round(6).tolist() == [-5, -6.666667, 2, -2]


@pytest.mark.parametrize(
    "after", [(0.089, 3, 80, 60), (0.1, 3.4, 80, 60), (0.1, 3, 76, 60), (0.1, 3, 80, 64)]
)
def test_what_changes_for_better_or_worse_has_not(after):
    table = rows_of((100, 0.1, 3, 80, 60), (200, *after))
    assert not encoders_table.converged(table)["plain 10", 200]


def test_the_mean_over_seeds_counts_and_only_seeds_that_both_have():
    up, down = (
        rows_of((100, 0.1, 3, 80, 60), (200, 0.1, 3, 86, 60)),
        rows_of((100, 0.1, 3, 86, 60), (200, 0.1, 3, 80, 60), seeds=(1,)),
    )
    assert not encoders_table.converged(up)["plain 10", 200]
    both = pd.concat([up, down])
    assert encoders_table.converged(both)["plain 10", 200]
    short = rows_of((100, 0.1, 3, 20, 60), seeds=(2,))
    assert encoders_table.converged(pd.concat([both, short]))["plain 10", 200]
    twice = pd.concat([both, up.assign(device="cuda"), up.assign(device="cuda")])
    assert encoders_table.converged(twice)["plain 10", 200]  # a seed counts once
    alone = rows_of((200, 0.1, 3, 80, 60), seeds=(7,))
    assert encoders_table.changes(pd.concat([short, alone])).empty


def test_a_training_is_held_against_its_own_shorter_one_where_there_is_one():
    here = rows_of((100, 0.1, 3, 80, 60), (200, 0.1, 3, 81, 60))
    there = rows_of((100, 0.1, 3, 10, 60), (200, 0.1, 3, 10, 60), (400, 0.1, 3, 12, 60))
    both = pd.concat([here, there.assign(device="cuda")])
    assert encoders_table.changes(both).loc["plain 10"]["first_both"].to_dict() == {
        200: 0.5,
        400: 2,
    }
    moved = rows_of((400, 0.1, 3, 78, 60)).assign(device="cuda")
    assert (
        encoders_table.changes(pd.concat([here, moved])).loc[("plain 10", 400), "first_both"] == -3
    )


def test_a_length_is_held_against_the_nearest_one_of_half_or_less():
    table = rows_of((50, 0.3, 3, 80, 60), (100, 0.2, 3, 80, 60), (150, 0.1, 3, 80, 60),
                    (201, 0.19, 3, 80, 60))  # fmt: skip
    assert encoders_table.converged(table)["plain 10"].to_dict() == {
        100: False, 150: False, 201: True
    }  # fmt: skip


def test_pca_does_not_count_and_test_scores_do_not_matter():
    table = rows_of((100, 0.1, 3, 80, 60), (200, 0.1, 3, 80, 60))
    other = rows_of((100, 0.1, 3, 80, 60), (200, 0.5, 9, 20, 20)).assign(split="test")
    level = encoders_table.converged(pd.concat([table, other, table.assign(encoder="PCA 10")]))
    assert level["plain 10", 200] and set(level.index.get_level_values(0)) == {"plain 10"}


def test_equal_lengths_are_checkpoints_of_the_study():
    for lengths in encoders_table.EQUAL.values():
        assert set(lengths) == set(encoders.CAES)
        assert all(n in encoders.CHECKPOINTS[encoder] for encoder, n in lengths.items())
    cost = {
        encoder: encoders.mflop_an_image(encoders.vision.make_autoencoder(*made))
        for encoder, made in encoders.CAES.items()
    }
    spent = [n * cost[encoder] for encoder, n in encoders_table.EQUAL["compute"].items()]
    assert max(spent) == pytest.approx(min(spent), rel=1e-3)


def test_rows_are_taken_at_each_eyes_own_length():
    rows = pd.concat([rows_of((1, 5, 0, 0, 0), (2, 6, 0, 0, 0), encoder=e) for e in ("a", "b")])
    found = encoders_table.at(rows, {"b": 1, "a": 2}, "held_out")
    assert found[["encoder", "pixel_error"]].values.tolist() == [["b", 5], ["a", 6]]
    assert found["thousands"].tolist() == [0.001, 0.002] and (found["tflop"] == 5).all()
    with pytest.raises(ConfigError, match="the table has no b of 3 presentations"):
        encoders_table.at(rows, {"a": 1, "b": 3}, "held_out")
    with pytest.raises(ConfigError, match="no a of 1 pres"):
        encoders_table.at(rows, {"a": 1})


def test_a_summary_gives_mean_lowest_and_highest_of_the_seeds():
    parts = [rows_of((1, 10.0 + s, 4, 0, 0), seeds=(s,)) for s in (0, 1, 5)]
    rows = pd.concat([*parts, rows_of((1, 3.04, 4, 0, 0), encoder="PCA 10")])
    table = encoders_table.summary(rows, {"pixel_error": ("error", 1), "first_place_mm": ("mm", 2)})
    assert table.index.tolist() == ["plain 10", "PCA 10"]
    assert table.loc["plain 10"].tolist() == ["3", "12.0 (10.0-15.0)", "4.00"]
    assert table.loc["PCA 10"].tolist() == ["1", "3.0", "4.00"]
