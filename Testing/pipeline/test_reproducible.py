"""The same input gives the same bytes, whatever the threads and the surroundings (H57)."""

import hashlib
import os
import shutil
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor

import pytest
from pypdf import PdfReader

FILES = {"plan.json", "schedule.csv", "markers.mrk.json", "prescription.pdf", "manifest.json"}


def threads(count):
    """Every pool of ours and of the libraries with so many threads."""
    several = count > 1
    return {
        "HEXAFIX_THREADS": str(count),
        "OPENBLAS_NUM_THREADS": str(count),
        "OMP_NUM_THREADS": str(count),
        "RAYON_NUM_THREADS": str(count),
        # the picture: the rasteriser draws by itself without threads, VTK's filters have their own
        "LP_NUM_THREADS": str(count if several else 0),
        "VTK_SMP_BACKEND_IN_USE": "STDThread" if several else "Sequential",
        "VTK_SMP_MAX_THREADS": str(count),
    }


SURROUNDINGS = {
    "one thread": {
        **threads(1),
        "PYTHONHASHSEED": "1",
        "LC_ALL": "C.UTF-8",
        "TZ": "UTC",
    },
    "two threads, a day later in the east, no locale": {
        **threads(2),
        "PYTHONHASHSEED": "22",
        "TZ": "Pacific/Kiritimati",
        "LC_ALL": "C",
        "PYTHONCOERCECLOCALE": "0",
        "PYTHONUTF8": "0",
    },
    "eight threads, a day earlier in the west, commas": {
        **threads(8),
        "PYTHONHASHSEED": "333",
        "TZ": "Pacific/Pago_Pago",
        "LC_ALL": "de_DE.UTF-8",
        "LANG": "tr_TR.UTF-8",
        "PYTHONOPTIMIZE": "1",
    },
}
UMASKS = (0o022, 0o077, 0o002)


@pytest.fixture(scope="module")
def exports(a_phantom, tmp_path_factory):
    """One case planned in a process of its own in each of the surroundings."""
    from hexafix.phantom import write_phantom

    top = tmp_path_factory.mktemp("reproducible")
    write_phantom(a_phantom, top / "0" / "case")

    def plan(number):
        folder = top / str(number)
        if number:
            shutil.copytree(top / "0" / "case", folder / "case")
        (folder / "tmp").mkdir()
        surroundings = list(SURROUNDINGS.values())[number]
        # run 0 is told absolute paths from elsewhere, the others relative ones
        base = folder if number == 0 else "."
        run = subprocess.run(
            [sys.executable, "-m", "hexafix", "plan", f"{base}/case", "--out", f"{base}/out", "-q"],
            capture_output=True,
            text=True,
            check=False,
            cwd=top if number == 0 else folder,
            umask=UMASKS[number],
            env=os.environ
            | surroundings
            | {"PYTHONPATH": os.pathsep.join(p for p in sys.path if p)}
            | {"TMPDIR": str(folder / "tmp"), "HOME": str(folder)},
        )
        assert run.returncode == 0, run.stderr
        assert list((folder / "tmp").iterdir()) == []
        return folder / "out"

    with ThreadPoolExecutor(2) as pool:
        return dict(zip(SURROUNDINGS, pool.map(plan, range(len(SURROUNDINGS))), strict=True))


@pytest.mark.parametrize("name", sorted(FILES))
def test_a_file_has_the_same_bytes_in_all_surroundings(exports, name):
    found = {
        surroundings: hashlib.sha256((folder / name).read_bytes()).hexdigest()
        for surroundings, folder in exports.items()
    }
    assert len(set(found.values())) == 1, found


def test_the_compared_prescriptions_hold_the_rendered_picture(exports):
    for folder in exports.values():
        assert {path.name for path in folder.iterdir()} == FILES
        pages = PdfReader(folder / "prescription.pdf").pages
        text = " ".join(" ".join(page.extract_text().split()) for page in pages)
        assert "Rendered by VTK at the recognised poses, bone surface" in text
