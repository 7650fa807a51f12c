"""Shapes in annotations are checked in every test; small data and models that many tests use."""

import os
import sys
from dataclasses import replace
from functools import partial

import hypothesis
import jaxtyping
import numpy as np
import pytest

# PyTorch is imported by the tests that need it: it is 150 MB in the process that hands tests out.
os.environ["OMP_NUM_THREADS"] = "1"
hypothesis.settings.register_profile("ptae", deadline=None)  # a busy machine is no failure
hypothesis.settings.load_profile("ptae")
jaxtyping.install_import_hook("ptae_lite", "typing_rules.checked")

FEATURES = 6
EYE = "e" * 64


def pytest_addoption(parser):
    parser.addoption("--lab", choices=("two", "all"), default="two",
                     help="how many chapters are tried in JupyterLab")  # fmt: skip
    parser.addoption("--screenshots", action="store_true",
                     help="keep pictures of all pages in build/screenshots")  # fmt: skip


@pytest.fixture(autouse=True)
def closed():
    """No figure stays open for the next test."""
    yield
    if "matplotlib.pyplot" in sys.modules:
        sys.modules["matplotlib.pyplot"].close("all")


@pytest.fixture
def unchecked():
    """Annotations are not checked: what a reader meets, who runs the library without the hook."""
    jaxtyping.config.update("jaxtyping_disable", True)
    yield
    jaxtyping.config.update("jaxtyping_disable", False)


@pytest.fixture(scope="session")
def simulator():
    """PyBullet; a test that asks for it is skipped where it is not installed."""
    return pytest.importorskip("pybullet", reason="PyBullet is not installed")


@pytest.fixture(scope="session")
def samples():
    """864 made-up samples in the order of the data set: smooth joints and features."""
    from ptae_lite.data.samples import Samples
    from ptae_lite.language import patterns

    rng = np.random.default_rng(1)
    pattern = np.repeat(np.arange(144), 6)
    frames = np.array([patterns()[i].frames for i in pattern])
    inside = (np.arange(100) < frames[:, None])[..., None]
    share = (np.arange(100) / (frames[:, None] - 1))[..., None]  # 0 to 1 over the clip

    def waves(count):
        rate, phase = rng.uniform(1, 3, (864, 1, count)), rng.uniform(0, 6, (864, 1, count))
        return (np.sin(rate * share + phase) * inside).astype(np.float32)

    return Samples(
        joints=waves(5),
        features=waves(FEATURES),
        frames=frames,
        pattern=pattern,
        variation=np.tile(np.arange(6), 144),
        encoder=EYE,
    )


def choose(samples, indices):
    """A part of the samples."""
    columns = ("joints", "features", "frames", "pattern", "variation")
    return replace(samples, **{name: getattr(samples, name)[indices] for name in columns})


@pytest.fixture(scope="session")
def few(samples):
    """36 of the samples, 24 to train and 12 to test, slow and fast: enough for quick trainings."""
    indices = [np.flatnonzero(samples.pattern == i) for i in (0, 7, 72, 73, 2, 78)]
    return choose(samples, np.concatenate(indices))


@pytest.fixture(scope="session")
def scaling(samples):
    from ptae_lite.data.scaling import fit_scaling

    return fit_scaling(samples, samples.split("train"))


@pytest.fixture(scope="session")
def source(samples, scaling):
    from ptae_lite.data.scaling import prepare
    from ptae_lite.data.signals import Source

    return Source(prepare(samples, scaling))


@pytest.fixture(scope="session")
def tiny():
    """Sizes of a PTAE that trains in no time."""
    from ptae_lite.models import PTAEConfig

    sizes = {"hidden": 16, "heads": 2, "feed_forward": 32, "decoder_units": 12}
    return PTAEConfig(features=FEATURES, dropout=0.0, **sizes)


@pytest.fixture(scope="session")
def small_configs(tiny):
    """Sizes for each model that train in no time."""
    from ptae_lite.models import PGAEConfig, PRAEConfig, PVAEConfig

    sizes = {"features": FEATURES, "code": 8, "units": 10}
    return {
        "ptae": tiny,
        "pgae": PGAEConfig(**sizes),
        "pvae": PVAEConfig(**sizes),
        "prae": PRAEConfig(**sizes),
    }


@pytest.fixture
def small_experiments(monkeypatch, small_configs):
    """Experiments are of tiny models and few epochs; keeps those that were trained."""
    from ptae_lite.experiments import experiment
    from ptae_lite.training import Recipe

    asked, real, models = [], experiment.Experiment.fit, experiment.MODELS

    def fit(one, *rest, **more):
        asked.append(one)
        return real(one, *rest, **more)

    few_epochs = Recipe(epochs=6, batch=8)
    small = {
        k: v._replace(config=partial(replace, small_configs[k]), recipe=few_epochs)
        for k, v in models.items()
    }
    monkeypatch.setattr(experiment, "MODELS", small)
    monkeypatch.setattr(experiment.Experiment, "fit", fit)
    return asked


@pytest.fixture(scope="session")
def trained(few, tiny):
    """A tiny PTAE after one epoch: it knows nothing, but can be asked everything."""
    from ptae_lite.training import Recipe, train

    return train(few, Recipe(epochs=1, batch=8), config=tiny)


@pytest.fixture(scope="module")
def asked():
    """The model that the pages ask, the recording, its source for the model, the test samples."""
    from ptae_lite import artefacts
    from ptae_lite.data.samples import load_samples
    from ptae_lite.data.signals import Source
    from ptae_lite.models import checkpoint

    samples = load_samples("recording")
    ptae = checkpoint.load(artefacts.stored("weights/ptae.safetensors"))
    return ptae, samples, Source(ptae.dataset(samples)), samples.split("test")


@pytest.fixture
def make_batch(source):
    """A function that wires sample numbers to one signal."""
    import torch

    from ptae_lite.data.signals import build, signal_number

    def make(indices, signal, alternative=0):
        count = len(indices)
        signals = torch.full((count,), signal_number(signal))
        return build(source, torch.tensor(indices), signals, torch.full((count,), alternative))

    return make


@pytest.fixture(scope="module")
def browser():
    """A running Chromium."""
    from pages import chromium

    with chromium() as running:
        yield running


@pytest.fixture
def page(browser, folder):
    """The first page of the test module's `folder`, opened."""
    from pages import opened

    with opened(browser) as one:
        one.goto((folder / "index.html").as_uri())
        yield one
