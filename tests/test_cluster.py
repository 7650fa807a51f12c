"""A study on a cluster: a scheduler here, bound to this machine alone, gives the serial rows."""

import json
import warnings

import pandas as pd
import pytest

import ptae_lite.__main__ as cli
from ptae_lite.errors import ConfigError
from ptae_lite.experiments import supervision, supervision_grid, tables
from ptae_lite.experiments.supervision_grid import Job
from ptae_lite.training import Recipe

distributed = pytest.importorskip("distributed", reason="the extra `cluster` is not installed")
pytestmark = pytest.mark.extras
JOBS = [Job("ptae", "samples", "paper", share, 0) for share in (50, 25)]


@pytest.fixture(scope="module")
def cluster():
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of Dask about itself
        with distributed.LocalCluster(
            host="127.0.0.1", n_workers=1, threads_per_worker=1, dashboard_address=None,
            worker_dashboard_address=None,
        ) as made:  # fmt: skip
            yield made


def test_it_listens_on_this_machine_alone(cluster):
    addresses = [cluster.scheduler_address, *cluster.scheduler_info["workers"]]
    assert all(address.startswith("tcp://127.0.0.1:") for address in addresses)


@pytest.mark.filterwarnings("ignore")
def test_a_cluster_gives_the_rows_that_one_process_gives(cluster, few, tmp_path):
    recipe, made = Recipe(epochs=1, batch=8), []
    for name, where in (("serial", {}), ("dask", {"cluster": cluster.scheduler_address})):
        totals = []
        table = supervision.study(
            few, tmp_path / name, JOBS, recipe,
            progress=lambda results, total, seen=totals: seen.append(total) or results, **where,
        )  # fmt: skip
        assert totals == [2]
        made.append(table.drop(columns="seconds"))
    pd.testing.assert_frame_equal(*made)
    said = [(tmp_path / n / "supervision_sentences.csv").read_text() for n in ("serial", "dask")]
    assert said[0] == said[1]


@pytest.mark.filterwarnings("ignore")
def test_the_command_takes_the_address_of_a_cluster(cluster, few, monkeypatch, capsys, tmp_path):
    monkeypatch.setattr("ptae_lite.data.samples.load_samples", lambda data, holdout: few)
    options = ["--models", "linear", "--variants", "random", "--shares", "50", "--cluster",
               cluster.scheduler_address, "--out", str(tmp_path), "--json"]  # fmt: skip
    assert cli.main(["study", "supervision", *options]) == 0
    assert json.loads(capsys.readouterr().out)["rows"] == supervision_grid.DRAWS


@pytest.mark.filterwarnings("ignore")
def test_workers_that_would_mix_two_trainings_are_refused():
    refused = pytest.raises(ConfigError, match="has 2 threads, and two .* --nthreads 1")
    with refused, distributed.LocalCluster(
        host="127.0.0.1", n_workers=1, threads_per_worker=2, dashboard_address=None,
        worker_dashboard_address=None,
    ) as made:  # fmt: skip
        tables.run(divmod, [(7, 2)], print, cluster=made.scheduler_address)


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("address", ["tcp://127.0.0.1:1", "nowhere", ""])
def test_an_address_where_no_scheduler_answers_is_refused(address, monkeypatch):
    monkeypatch.setattr(tables, "PATIENCE_S", 1)
    with pytest.raises(ConfigError, match="no Dask scheduler answers at"):
        tables.run(divmod, [(7, 2)], print, cluster=address)
