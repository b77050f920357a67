"""One setting rules the threads of HexaFix's own pools, and nonsense in it is refused."""

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from hexafix.errors import InputError
from hexafix.imaging import Volume, fingerprint, pixel_data
from hexafix.imaging.dicom_volume import read_dicom
from hexafix.phantom.dicom_series import write_dicom_series
from hexafix.progress import silent
from hexafix.threads import DEFAULT, MOST, thread_count


@pytest.mark.parametrize(("text", "count"), [("1", 1), (" 8 ", 8), ("064", 64), ("", DEFAULT)])
def test_the_environment_sets_the_number(monkeypatch, text, count):
    monkeypatch.setenv("HEXAFIX_THREADS", text)
    assert thread_count() == count


def test_without_it_the_callers_default_counts(monkeypatch):
    monkeypatch.delenv("HEXAFIX_THREADS", raising=False)
    assert (thread_count(), thread_count(5)) == (DEFAULT, 5)


@pytest.mark.parametrize("text", ["0", "-1", "2.0", "two", "65", "1000", "²", "1e1", "9" * 5000])
def test_what_is_no_number_of_threads_is_refused(monkeypatch, text):
    monkeypatch.setenv("HEXAFIX_THREADS", text)
    with pytest.raises(InputError) as caught:
        thread_count()
    (fault,) = caught.value.faults
    assert (fault.code, fault.where) == ("thread-count", "HEXAFIX_THREADS")
    assert fault.limit == f"1 to {MOST}"


@pytest.mark.parametrize("count", [1, 3])
def test_the_readers_pools_have_that_many_threads(monkeypatch, tmp_path, count):
    seen = []

    class Watched(ThreadPoolExecutor):
        def __init__(self, workers):
            seen.append(workers)
            super().__init__(workers)

    small = Volume(np.arange(4 * 5 * 6, dtype=np.int16).reshape(4, 5, 6), np.eye(4))
    write_dicom_series(small, tmp_path / "ct", identity="threads")
    for module in (fingerprint, pixel_data):
        monkeypatch.setattr(module, "ThreadPoolExecutor", Watched)
    monkeypatch.setenv("HEXAFIX_THREADS", str(count))
    volume = read_dicom(tmp_path / "ct", None, silent)
    assert fingerprint.fingerprint(volume.voxels, volume.ijk_to_lps) == volume.source.sha256
    assert seen == [count, count]
