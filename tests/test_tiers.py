"""Tiers, and the paper's numbers: what a chapter reads before anything else."""

import pytest

from ptae_lite import run_mode
from ptae_lite.data.signals import PTAE_SIGNALS
from ptae_lite.errors import ConfigError
from ptae_lite.experiments import incongruence, supervision_grid
from ptae_lite.paper import reported


def test_replay_is_the_default(monkeypatch):
    monkeypatch.delenv("PTAE_TIER", raising=False)
    assert run_mode.tier() == "replay"


@pytest.mark.parametrize(("name", "value"), [("replay", 1), ("quick", 2), ("full", 3)])
def test_a_tier_takes_its_own_value(monkeypatch, name, value):
    monkeypatch.setenv("PTAE_TIER", name)
    assert run_mode.by_tier(replay=1, quick=2, full=3) == value
    assert run_mode.tier() == name and run_mode.TIERS[name]


@pytest.mark.parametrize("name", ["fast", "", "Full"])
def test_an_unknown_tier_is_refused_with_those_there_are(monkeypatch, name):
    monkeypatch.setenv("PTAE_TIER", name)
    for call in (run_mode.tier, lambda: run_mode.by_tier(replay=1, quick=2, full=3)):
        with pytest.raises(ConfigError, match=f"PTAE_TIER is '{name}'; .* replay, quick, full"):
            call()


def claims():
    groups = {name: getattr(reported, name) for name in ("REGULAR",)}
    for name, group in (groups | reported.BY_SHARE).items():
        for key, claim in group.items():
            yield pytest.param(claim, id=f"{name} {key}")
    for signal, numbers in reported.CONFLICTS.items():
        for count, claim in numbers.items():
            yield pytest.param(claim, id=f"{signal} {count}")


@pytest.mark.parametrize("claim", list(claims()))
def test_every_claim_is_in_percent_and_says_where_it_stands(claim):
    assert 0 <= claim.value <= 100
    assert claim.says and claim.section.endswith("results")


def test_the_papers_numbers():
    """As the text states them, once more."""
    assert {k: c.value for k, c in reported.REGULAR.items()} == {
        "describe_accuracy": 100, "repeat_language_accuracy": 100,
        "execute_nrmse": 0.99, "repeat_action_nrmse": 1.03,
    }  # fmt: skip
    shares = {
        key: {s: c.value for s, c in found.items()} for key, found in reported.BY_SHARE.items()
    }
    assert shares == {
        ("ptae", "describe_accuracy", "iterations"): dict.fromkeys((1, 2, 10, 20, 50, 66.6), 100),
        ("pgae", "describe_accuracy", "iterations"): {1: 36, 2: 50, 20: 95},
        ("ptae", "describe_accuracy", "samples"):
            {1: 33, 10: 81, 20: 100, 50: 100, 66.6: 100, 100: 100},
        ("pgae", "describe_accuracy", "samples"): {50: 80},
        ("ptae", "execute_nrmse", "samples"): {1: 4, 100: 0.99},
        ("pgae", "execute_nrmse", "samples"): {1: 14, 66.6: 8, 100: 0.5},
    }  # fmt: skip
    conflicts = {
        signal: {count: claim.value for count, claim in numbers.items()}
        for signal, numbers in reported.CONFLICTS.items()
    }
    assert conflicts == {
        "describe": {0: 100, 3: 95}, "repeat language": {0: 100, 1: 0, 2: 0, 3: 0},
        "execute": {0: 0.99, 3: 4.95}, "repeat action": {0: 1.03, 3: 1.09},
    }  # fmt: skip


def test_claims_are_of_things_that_can_be_measured_here(trained, few, samples):
    from ptae_lite.evaluation import evaluate

    assert set(reported.REGULAR) <= set(evaluate(trained, few))
    assert set(reported.CONFLICTS) == set(incongruence.EXTRA_INPUT) == set(PTAE_SIGNALS)
    grid = {(job.model, job.mode, job.share) for job in supervision_grid.grid()}
    for (model, measure, mode), found in reported.BY_SHARE.items():
        assert measure in evaluate(trained, few)
        for share in found:
            regular = supervision_grid.REGULAR[mode] == share
            assert regular or (model, mode, share) in grid
