"""Spoil thousands of files and see that each is refused or read as what it says.

    python Testing/fuzz/campaign.py --mutants 10000 --seed 1 --out report.json

Mutant n of a seed is always the same. They are read in worker processes, many in one; where a
worker dies or does not come back, the mutant it was at is read once more in HexaFix's own way,
with each decoder in a child of its own, and only that counts: a decoder may die, the program may
not.
"""

from __future__ import annotations

import argparse
import faulthandler
import json
import random
import subprocess
import sys
import tempfile
import threading
import traceback
import warnings
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

_HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(_HERE), str(_HERE.parents[1] / "HexaFixModule")]

KINDS = {"dicom": 0.44, "pixels": 0.16, "files": 0.20, "json": 0.20}
"""What share of the mutants each kind has."""
SECONDS = 20
"""A mutant that takes longer hangs; the worst that is allowed takes a fraction of it."""
_ALONE_SECONDS = 90


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--mutants", type=int, default=10_000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--out", type=Path)
    parser.add_argument("--only", nargs="*", help="mutants to read, as kind:number")
    parser.add_argument("--work", nargs="*", help=argparse.SUPPRESS)
    parser.add_argument("--alone", action="store_true", help="each decoder in its own child")
    options = parser.parse_args()
    if options.work is not None:
        work(options.work, options.seed, alone=options.alone)
        return 0
    names = options.only or list(mutants(options.mutants))
    report = run(names, options.seed, jobs=options.jobs, alone=options.alone)
    text = json.dumps(report, indent=2)
    if options.out:
        options.out.write_text(text + "\n")
    print(text)
    return 1 if report["defects"] else 0


def mutants(count: int) -> Iterator[str]:
    """Names of the mutants of a campaign."""
    for kind, share in KINDS.items():
        yield from (f"{kind}:{number}" for number in range(round(count * share)))


# the parent -------------------------------------------------------------------------------


def run(names: list[str], seed: int, *, jobs: int, alone: bool = False) -> dict[str, Any]:
    """Read all mutants and count what became of them."""
    results: list[dict[str, Any]] = []
    threads = [
        threading.Thread(target=_serve, args=(names[job::jobs], seed, results, alone))
        for job in range(jobs)
    ]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    return _report(results, seed, len(names))


def _serve(names: list[str], seed: int, results: list[dict[str, Any]], alone: bool) -> None:
    """Give mutants to one worker after the other until none is left."""
    left = list(names)
    while left:
        done, culprit, trace = _one_worker(left, seed, alone=alone)
        results += done
        left = left[len(done) :]
        if culprit is None:
            continue
        left.remove(culprit)
        if alone:
            results.append({"mutant": culprit, "defect": f"the program died or hung: {trace}"})
            continue
        again, still, trace = _one_worker([culprit], seed, alone=True)
        results += [{**row, "died_in_decoder": True} for row in again]
        if still is not None:
            results.append({"mutant": culprit, "defect": f"the program died or hung: {trace}"})


def _one_worker(
    names: list[str], seed: int, *, alone: bool
) -> tuple[list[dict[str, Any]], str | None, str]:
    """Rows of the mutants that a worker finished, and the one at which it ended if it did."""
    batch = names[:400]
    command = [sys.executable, str(Path(__file__)), "--seed", str(seed), "--work", *batch]
    command += ["--alone"] if alone else []
    rows: list[dict[str, Any]] = []
    with (
        tempfile.TemporaryFile("w+") as errors,
        subprocess.Popen(command, stdout=subprocess.PIPE, stderr=errors, text=True) as worker,
    ):
        assert worker.stdout is not None
        rows += [json.loads(line) for line in worker.stdout]
        worker.wait()
        errors.seek(0)
        trace = errors.read()[-2000:]
    if len(rows) == len(batch):
        return rows, None, ""
    return rows, batch[len(rows)], trace


def _report(results: list[dict[str, Any]], seed: int, asked: int) -> dict[str, Any]:
    by_kind: dict[str, Counter[str]] = {kind: Counter() for kind in KINDS}
    codes: Counter[str] = Counter()
    seeds: dict[str, Counter[str]] = {}
    for row in results:
        outcome = "defect" if "defect" in row else "refused" if row["refused"] else "loaded"
        by_kind[row["mutant"].split(":")[0]][outcome] += 1
        seeds.setdefault(row.get("seed", "?"), Counter())[outcome] += 1
        codes.update(set(row.get("refused") or ()))
    return {
        "seed": seed,
        "asked": asked,
        "mutants": len(results),
        "kinds": {kind: dict(counts) for kind, counts in by_kind.items()},
        "seeds": {name: dict(counts) for name, counts in sorted(seeds.items())},
        "refused_by_code": dict(codes.most_common()),
        "deaths_and_hangs_in_a_decoder": sum("died_in_decoder" in row for row in results),
        "defects": [row for row in results if "defect" in row],
    }


# the worker -------------------------------------------------------------------------------


def work(names: list[str], seed: int, *, alone: bool) -> None:
    """Read mutants one after the other; a line of JSON for each."""
    faulthandler.enable()
    channel = sys.stdout
    sys.stdout = sys.stderr
    _limit_memory()
    warnings.simplefilter("error")
    if not alone:
        _decode_here()
    with tempfile.TemporaryDirectory(prefix="hexafix-fuzz-") as place:
        for number, name in enumerate(names):
            faulthandler.dump_traceback_later(_ALONE_SECONDS if alone else SECONDS, exit=True)
            folder = Path(place, str(number))
            folder.mkdir()
            row = one(name, seed, folder)
            faulthandler.cancel_dump_traceback_later()
            print(json.dumps(row), file=channel, flush=True)


def _limit_memory() -> None:
    """No mutant may need more than this: a bomb shows as a MemoryError."""
    try:
        import resource
    except ImportError:
        return
    resource.setrlimit(resource.RLIMIT_AS, (6 << 30, 6 << 30))


def _decode_here() -> None:
    """Let this process do what a child does: it is one already, and there are thousands to read."""
    from hexafix.errors import ImageRefused
    from hexafix.imaging import decoding, itk_file, worker

    def run_here(task: str, arguments: list[Any], **_: Any) -> Iterator[Any]:
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                yield from {"decode": worker.decode, "itk": worker.itk}[task](arguments)
        except Exception as error:
            raise ImageRefused.of(
                "corrupt-pixel-data", "cannot be decoded", value=type(error).__name__, hazard="H09"
            ) from None

    decoding.run_isolated = run_here
    itk_file.run_isolated = run_here


def one(name: str, seed: int, folder: Path) -> dict[str, Any]:
    """Make one mutant, read it, and judge."""
    from hexafix.errors import HexaFixError

    rng = random.Random(f"{seed}:{name}")
    kind = name.split(":")[0]
    did: list[str] = []
    row: dict[str, Any] = {"mutant": name, "refused": None}
    try:
        read = {"json": _json, "files": _file}.get(kind, _dicom)
        row["seed"], wrong = read(kind, rng, folder, did)
        if wrong:
            row["defect"] = wrong
    except HexaFixError as refusal:
        row["refused"] = sorted({fault.code for fault in refusal.faults})
        if refusal.exit_code not in (2, 3):
            row["defect"] = f"exit code {refusal.exit_code}"
    except BaseException as error:
        last = traceback.extract_tb(error.__traceback__)[-1]
        place = f"{Path(last.filename).name}:{last.lineno}"
        row["defect"] = f"{type(error).__name__} at {place}: {error}"[:500]
        if isinstance(error, KeyboardInterrupt):
            raise
    row.setdefault("seed", did[0] if did else "?")
    if "defect" in row:
        row["did"] = did
    return row


def _dicom(kind: str, rng: random.Random, folder: Path, did: list[str]) -> tuple[str, str | None]:
    import dicom_oracle
    from dicom_mutations import Mutator
    from dicom_seeds import COMPRESSED
    from hexafix.imaging import read_volume

    seeds = _cached("dicom")
    names = [name for name in seeds if (name in COMPRESSED) == (kind == "pixels")]
    seed = seeds[rng.choice(names)]
    did.append(seed.name)
    mutate = Mutator(rng)
    mutate.did = did
    for name, content in mutate(seed).items():
        (folder / name).write_bytes(content)
    volume = read_volume(folder)
    return seed.name, dicom_oracle.why_wrong(volume, dicom_oracle.own_reading(folder))


def _file(kind: str, rng: random.Random, folder: Path, did: list[str]) -> tuple[str, str | None]:
    import file_fuzz
    from hexafix.imaging import read_volume

    seeds = _cached("files")
    name = rng.choice(list(seeds))
    did.append(name)
    for file, content in file_fuzz.spoil(seeds[name], rng, did).items():
        (folder / file).write_bytes(content)
    path = folder / next(iter(seeds[name]))
    return name, file_fuzz.why_wrong(read_volume(path), path)


def _json(kind: str, rng: random.Random, folder: Path, did: list[str]) -> tuple[str, str | None]:
    import json_fuzz

    seeds = _cached("json")
    name = rng.choice(list(seeds))
    did.append(name)
    what, content = seeds[name]
    return name, json_fuzz.read(what, json_fuzz.spoil(content, rng, did), folder)


_SEEDS: dict[str, Any] = {}


def _cached(kind: str) -> Any:
    if kind not in _SEEDS:
        if kind == "dicom":
            from dicom_seeds import dicom_seeds as make
        elif kind == "files":
            from file_fuzz import file_seeds as make
        else:
            from json_fuzz import json_seeds as make
        _SEEDS[kind] = make()
    return _SEEDS[kind]


if __name__ == "__main__":
    sys.exit(main())
