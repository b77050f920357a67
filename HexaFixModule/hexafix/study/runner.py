"""Work spread over threads, processes or machines; results come back in order."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager, nullcontext
from importlib.util import find_spec
from itertools import islice
from typing import Any, TypeVar

from hexafix.errors import InputError, MissingLibrary
from hexafix.threads import thread_count

Result = TypeVar("Result")

ROUND = 8
"""Tasks handed out at once, for each worker: bounds what waits to be collected."""


def in_order(
    function: Callable[..., Result],
    tasks: Iterable[tuple[Any, ...]],
    *,
    workers: int | None = None,
    backend: str | None = None,
) -> Iterator[Result]:
    """Results of ``function(*task)`` in the order of the tasks, a bounded number at a time.

    Parameters
    ----------
    function : callable
        Importable by its name, so that other processes find it.
    tasks : iterable of tuple
        Arguments; consumed as the work goes on.
    workers : int, optional
        None: the threads of `thread_count`, else every core here, or every worker of a cluster.
    backend : str, optional
        A joblib backend (``threading``, ``loky``, ``dask`` or one the caller registered). None:
        Dask if a client is connected, else the backend of the caller's ``parallel_config``, else
        threads, which need no joblib.
    """
    if backend is None and dask_connected():
        backend = "dask"
    if backend is None and find_spec("joblib") is None:
        yield from _on_threads(function, tasks, workers)
        return
    joblib = _joblib()
    context = joblib.parallel_config(backend=backend) if backend else nullcontext()
    jobs = workers or (-1 if backend else _threads())
    with context, joblib.Parallel(n_jobs=jobs, prefer="threads") as parallel:
        for batch in _rounds(tasks, ROUND * max(1, joblib.effective_n_jobs(jobs))):
            yield from parallel(joblib.delayed(function)(*task) for task in batch)


def dask_connected() -> bool:
    """Whether this process has a Dask client; imports nothing."""
    distributed = sys.modules.get("distributed")
    if distributed is None:
        return False
    try:
        distributed.default_client()
    except ValueError:
        return False
    return True


@contextmanager
def dask_cluster(address: str | None) -> Iterator[None]:
    """A Dask client connected for a while; nothing without an address.

    Raises
    ------
    MissingLibrary
        If dask.distributed or joblib is not installed.
    InputError
        If no scheduler answers at the address.
    """
    if address is None:
        yield
        return
    _joblib()
    try:
        from distributed import Client  # pyright: ignore[reportMissingImports]
    except ImportError as error:
        raise MissingLibrary.of(
            "missing-library",
            "a Dask cluster needs dask.distributed",
            where="--dask",
            next_step="pip install distributed",
        ) from error
    try:
        client = Client(address)
    except (OSError, ValueError) as error:
        raise InputError.of(
            "no-scheduler",
            "no Dask scheduler answers",
            value=address,
            where="--dask",
            next_step="give the address that the scheduler prints, such as tcp://host:8786",
        ) from error
    with client:
        yield


def _joblib() -> Any:
    try:
        import joblib
    except ImportError as error:
        raise MissingLibrary.of(
            "missing-library",
            "work beyond threads needs joblib",
            next_step="pip install 'hexafix[study]'",
        ) from error
    return joblib


def _on_threads(
    function: Callable[..., Result], tasks: Iterable[tuple[Any, ...]], workers: int | None
) -> Iterator[Result]:
    count = workers or _threads()
    with ThreadPoolExecutor(count) as pool:
        for batch in _rounds(tasks, ROUND * count):
            yield from pool.map(lambda task: function(*task), batch)


def _threads() -> int:
    return thread_count(os.cpu_count() or 1)


def _rounds(tasks: Iterable[tuple[Any, ...]], size: int) -> Iterator[list[tuple[Any, ...]]]:
    rest = iter(tasks)
    while batch := list(islice(rest, size)):
        yield batch
