"""Threads, processes and clusters give one answer, in order, a bounded number at a time."""

import sys
import types

import joblib
import numpy as np
import pytest
from hexafix.errors import InputError, MissingLibrary
from hexafix.study import ErrorModel, runner
from hexafix.study.error_model import error_maps
from hexafix.study.jacobians import model_jacobians
from hexafix.study.layouts import three_marker_layouts
from hexafix.study.runner import ROUND, dask_cluster, dask_connected, in_order
from hexafix.study.sampling import LinearKernel, sample_moments
from joblib._parallel_backends import ThreadingBackend
from joblib.externals.loky import get_reusable_executor


@pytest.fixture(scope="module")
def kernel():
    layouts = three_marker_layouts(30).take(slice(20, None))
    maps = error_maps(model_jacobians(layouts, ErrorModel()), layouts, ErrorModel())
    return LinearKernel(np.ascontiguousarray(maps), np.arange(len(layouts)))


@pytest.fixture(scope="module")
def alone(kernel):
    return sample_moments(kernel, samples=4100, seed=2, backend="sequential")


def moments(kernel, **options):
    return sample_moments(
        kernel, samples=4100, seed=2, layouts_per_task=7, blocks_per_task=2, **options
    )


def assert_same(found, alone):
    assert np.array_equal(found.mean, alone.mean)
    assert np.array_equal(found.covariance, alone.covariance)


@pytest.mark.parametrize("backend", [None, "threading", "loky"])
def test_every_backend_gives_the_same_bits(kernel, alone, backend):
    assert_same(moments(kernel, workers=2, backend=backend), alone)
    if backend == "loky":
        get_reusable_executor().shutdown(wait=True)


def test_threads_serve_where_joblib_is_missing(kernel, alone, monkeypatch):
    monkeypatch.setattr(runner, "find_spec", lambda name: None)
    monkeypatch.setitem(sys.modules, "joblib", None)
    assert_same(moments(kernel, workers=2), alone)
    with pytest.raises(MissingLibrary, match="joblib"):
        moments(kernel, backend="loky")


class Recording(ThreadingBackend):
    """A cluster that runs here and remembers that it was asked."""

    asked = 0

    def submit(self, func, callback=None):
        type(self).asked += 1
        return super().submit(func, callback)

    def effective_n_jobs(self, n_jobs):
        return 3


@pytest.fixture
def a_cluster(monkeypatch):
    """dask.distributed with a connected client, whose joblib backend is `Recording`."""
    monkeypatch.setattr(Recording, "asked", 0)
    distributed = types.ModuleType("distributed")
    distributed.default_client = lambda: object()
    monkeypatch.setitem(sys.modules, "distributed", distributed)
    from joblib import parallel

    monkeypatch.setitem(parallel.BACKENDS, "dask", Recording)
    return distributed


def test_a_connected_dask_client_does_the_work(kernel, alone, a_cluster):
    assert dask_connected()
    assert_same(moments(kernel), alone)
    assert Recording.asked > 1


def test_without_a_client_nothing_is_sent(kernel, alone, a_cluster):
    def nobody():
        raise ValueError("No global client found")

    a_cluster.default_client = nobody
    assert not dask_connected()
    assert_same(moments(kernel), alone)
    assert Recording.asked == 0


def test_a_named_backend_is_used_though_a_client_is_connected(kernel, alone, a_cluster):
    assert_same(moments(kernel, backend="threading", workers=2), alone)
    assert Recording.asked == 0


def test_the_callers_parallel_config_is_kept(kernel, alone, monkeypatch):
    monkeypatch.setattr(Recording, "asked", 0)
    joblib.register_parallel_backend("recording", Recording)
    try:
        with joblib.parallel_config(backend="recording"):
            assert_same(moments(kernel, workers=2), alone)
    finally:
        joblib.parallel.BACKENDS.pop("recording")
    assert Recording.asked > 1


def test_an_address_connects_a_client_and_closes_it(a_cluster):
    seen = []

    class Client:
        def __init__(self, address):
            seen.append(address)

        def __enter__(self):
            return self

        def __exit__(self, *exception):
            seen.append("closed")

    a_cluster.Client = Client
    with dask_cluster("tcp://scheduler:8786"):
        assert seen == ["tcp://scheduler:8786"]
    assert seen[-1] == "closed"
    with dask_cluster(None):
        assert len(seen) == 2


def test_an_address_without_dask_is_refused_with_the_way_out(monkeypatch):
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(MissingLibrary, match="pip install distributed"), dask_cluster("tcp://x:1"):
        pass


@pytest.mark.parametrize("failure", [OSError("timed out"), ValueError("unknown address scheme")])
def test_an_address_where_nobody_answers_is_refused(a_cluster, failure):
    def client(address):
        raise failure

    a_cluster.Client = client
    with pytest.raises(InputError, match="no Dask scheduler answers"), dask_cluster("tcp://x:1"):
        pass


@pytest.mark.parametrize("backend", [None, "threading"])
def test_only_a_few_tasks_are_taken_ahead(backend):
    taken = []

    def tasks():
        for k in range(200):
            taken.append(k)
            yield (k,)

    results = in_order(abs, tasks(), workers=2, backend=backend)
    for k, result in enumerate(results):
        assert result == k
        assert len(taken) <= k + 2 * ROUND + 1
    assert len(taken) == 200
