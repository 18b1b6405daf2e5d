"""A cluster of two machines that are one: units go to both, one is lost half way, and the labels are the same."""

import os
import sys
import threading
import time

import pytest

from automos.core.errors import InputError
from automos.fleet.label import Resources, label_fleet
from automos.fleet.ray_cluster import RayCluster
from automos.fleet.sources import find_all
from automos.fleet.status import read_status

pytestmark = pytest.mark.slow

ray = pytest.importorskip("ray", reason="Ray is not installed: pip install '.[scale]'")


@pytest.fixture
def cluster():
    """Return a cluster of a head and another machine, of one core each."""
    from ray.cluster_utils import Cluster

    made = Cluster(initialize_head=True, head_node_args={"num_cpus": 1, "include_dashboard": False})
    made.other = made.add_node(num_cpus=1)
    yield made
    made.shutdown()


def label(fleet, cluster, out, work, **resources):
    resources = Resources(ray=cluster.address, memory_gb=0.5, work=work, **resources)
    return label_fleet(find_all(str(fleet.folder)), out, fleet.settings, resources)


def test_a_cluster_gives_the_same_labels_whole_or_cut(fleet, cluster, tmp_path):
    assert label(fleet, cluster, str(tmp_path / "out"), tmp_path).failed == {}
    assert fleet.differences(tmp_path / "out") == []
    assert label(fleet, cluster, str(tmp_path / "cut"), tmp_path, chunk=5).failed == {}
    assert fleet.differences(tmp_path / "cut") == []
    assert len({unit["place"] for unit in read_status(str(tmp_path / "cut")).units}) == 2


def test_a_machine_that_is_lost_half_way_costs_only_time(make_fleet, cluster, tmp_path):
    fleet, outcome = make_fleet(30), []
    run = threading.Thread(target=lambda: outcome.append(label(fleet, cluster, str(tmp_path / "out"), tmp_path)))
    run.start()
    while len(list((tmp_path / "out").glob("*/complete.json"))) < 15:
        assert run.is_alive()
        time.sleep(0.1)
    cluster.remove_node(cluster.other, allow_graceful=False)
    run.join(timeout=600)
    assert (len(outcome[0].labelled), outcome[0].failed) == (30, {})
    assert len({unit["place"] for unit in read_status(str(tmp_path / "out")).units}) == 2
    assert fleet.differences(tmp_path / "out") == []


def test_units_of_a_recording_bound_for_a_bucket_stay_where_its_results_wait(fleet, s3, cluster, tmp_path):
    assert label(fleet, cluster, "s3://bucket/out", tmp_path / "work", chunk=5).failed == {}
    s3.files.get("bucket/out/", str(tmp_path / "labels") + "/", recursive=True)
    assert fleet.differences(tmp_path / "labels") == []
    places = {}
    for unit in read_status("s3://bucket/out").units:
        places.setdefault(unit["recording"], set()).add(unit["place"])
    assert {len(there) for there in places.values()} == {1}


def test_a_cluster_without_a_machine_large_enough_is_told(cluster, caplog):
    with RayCluster(cluster.address, 10**8):
        assert caplog.text == ""
    with RayCluster(cluster.address, 10**15):
        assert "is to have 1000000.0 GB (--memory), but no machine of the cluster offers more than" in caplog.text


def test_a_cluster_that_is_not_there_is_told_in_a_sentence(fleet, tmp_path):
    with pytest.raises(InputError, match=r"no Ray cluster answers at 127\.0\.0\.1:1"):
        label_fleet(find_all(str(fleet.folder)), str(tmp_path), fleet.settings, Resources(ray="127.0.0.1:1"))


def test_workers_of_a_cluster_do_not_look_for_modules_where_its_caller_stands(cluster, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with RayCluster(cluster.address, 10**8):
        looked_at = ray.get(ray.remote(lambda: list(sys.path)).remote())
    assert not {"", ".", str(tmp_path)} & set(looked_at)
    assert os.getcwd() == str(tmp_path)
