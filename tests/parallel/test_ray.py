"""The same tasks on a Ray cluster of two node processes on this machine."""

from collections.abc import Iterator

import numpy as np
import pytest

from mecanum_env.errors import InputError
from mecanum_env.parallel import Task, WorkerLostError, Workers, executor, run_tasks

from .conftest import KILL

ray = pytest.importorskip("ray", reason="no Ray here; pip install ray")
# Ray leaves pipes and log files to the garbage collector.
pytestmark = [
    pytest.mark.filterwarnings("ignore::ResourceWarning"),
    pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning"),
    pytest.mark.filterwarnings("ignore::FutureWarning:ray"),
]


@pytest.fixture(scope="module")
def cluster() -> Iterator[Workers]:
    """Start two nodes of one processor each and return workers that join them."""
    from ray.cluster_utils import Cluster

    nodes = Cluster(initialize_head=True, head_node_args={"num_cpus": 1, "include_dashboard": False})
    nodes.add_node(num_cpus=1)
    nodes.wait_for_nodes()
    yield Workers("ray", ray_address=nodes.address)
    nodes.shutdown()


def test_both_nodes_work_and_results_are_in_order(cluster, task):
    node = "(__import__('time').sleep(0.5), __import__('ray').get_runtime_context().get_node_id())[1]"
    with executor(cluster) as pool:
        assert len(set(pool.run([task("node", node)] * 6))) == 2
        told = {}
        assert pool.run([task(f"{i}", f"{i}**2") for i in range(30)], told.__setitem__) == [
            i**2 for i in range(30)
        ]
        assert told == {i: i**2 for i in range(30)}


def test_the_bytes_are_those_of_this_process(cluster):
    rows = np.random.default_rng(0).standard_normal((400, 300))
    tasks = [Task("svd", np.linalg.svd, (rows, False, False)), Task("inv", np.linalg.inv, (rows.T @ rows,))]
    here, there = (run_tasks(tasks, workers) for workers in (Workers(jobs=1), cluster))
    assert [value.tobytes() for value in here] == [value.tobytes() for value in there]


def test_the_task_of_a_killed_worker_is_done_again(cluster, task, killed_once):
    tasks = [task("a", "1"), task("killed", killed_once), task("b", "2"), task("c", "3")]
    assert run_tasks(tasks, cluster) == [1, 7, 2, 3]


def test_a_task_that_always_kills_its_worker_is_one_clear_error(cluster, task):
    with pytest.raises(WorkerLostError, match="the task bad lost its worker process 3 times"):
        run_tasks([task("good", "1"), task("bad", KILL)], cluster)


def test_an_error_comes_with_the_name_of_its_task(cluster, task):
    with pytest.raises(ZeroDivisionError) as caught:
        run_tasks([task("fine", "1"), task("by zero", "1 / 0")], cluster)
    assert caught.value.__notes__[0] == "in the task by zero"


def test_the_address_may_stand_in_the_environment(cluster, task, monkeypatch):
    monkeypatch.setenv("RAY_ADDRESS", cluster.ray_address)
    nodes = "len(__import__('ray').nodes())"
    assert run_tasks([task("nodes", nodes)], Workers("ray", jobs=1)) == [2]


def test_an_address_without_a_cluster_is_refused(task):
    with pytest.raises(InputError, match=r"no Ray cluster at 127\.0\.0\.1:1"):
        run_tasks([task("one", "1")], Workers("ray", ray_address="127.0.0.1:1"))
