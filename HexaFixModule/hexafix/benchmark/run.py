"""Every goal measured in one run: value, goal, met or not."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import Any

from hexafix.errors import InputError

Row = dict[str, Any]


def run(names: Sequence[str] = (), *, quick: bool = False) -> list[Row]:
    """Measure the named groups, or all of them.

    Parameters
    ----------
    names : sequence of str
        Of `GROUPS`; empty for all.
    quick : bool
        Small samples: shows that everything runs, proves little.

    Returns
    -------
    list of dict
        ``group``, ``name``, ``value``, ``goal``, ``unit``, ``met``, ``detail``.

    Raises
    ------
    InputError
        If a name is unknown.
    """
    require_known(names, GROUPS, what="measurement")
    rows = []
    for name in names or GROUPS:
        rows += [{"group": name, **row} for row in GROUPS[name](quick)]
    return rows


def require_known(names: Iterable[str], known: Iterable[str], *, what: str) -> None:
    """Refuse names that nothing here goes by.

    Raises
    ------
    InputError
        With the names and those there are.
    """
    unknown = sorted(set(names) - set(known))
    if unknown:
        raise InputError.of(
            "benchmark-unknown",
            f"there is no such {what}",
            value=", ".join(unknown),
            limit=", ".join(known),
        )


def print_rows(rows: Sequence[Row]) -> None:
    """The rows as a table for people."""
    for row in rows:
        mark = "met   " if row["met"] else "MISSED"
        goal = f"goal {row['goal']:.6g}" if row["goal"] is not None else "no goal"
        text = f"{mark} {row['group']:<12} {row['name']}: {row['value']:.6g} {row['unit']} ({goal})"
        print(text + (f"; {row['detail']}" if row["detail"] else ""))


def _row(
    name: str, value: float, goal: float | None, unit: str, detail: str = "", *, low: float = 0.0
) -> Row:
    met = goal is None or low <= value <= goal
    return {"name": name, "value": float(value), "goal": goal, "unit": unit, "met": bool(met),
            "detail": detail}  # fmt: skip


def _balls(quick: bool) -> Iterator[Row]:
    from hexafix.benchmark.balls import accuracy

    for row in accuracy(placements=12 if quick else 100):
        paper = f"isosurface + least squares {row['paper_rms_3d_mm']:.4f} mm"
        yield _row(f"centre 3D RMS, {row['name']}", row["rms_3d_mm"], row["goal_mm"], "mm", paper)
        yield _row(f"bias along the rod, {row['name']}", abs(row["bias_along_rod_mm"]), 0.005, "mm")
        yield _row(
            f"actual over stated sigma, {row['name']}", row["sigma_ratio"], 1.5, "", low=1 / 1.5
        )
        yield _row(f"missed, {row['name']}", row["missed"], 0, "balls")


def _search(quick: bool) -> Iterator[Row]:
    from hexafix.benchmark.balls import search

    result = search(phantoms=2 if quick else 20, seed=4)
    detail = f"{result['balls']} balls in {result['phantoms']} phantoms"
    yield _row("balls missed", result["missed"], 0, "balls", detail)
    yield _row("balls invented", result["invented"], 0, "balls", detail)


def _speed(quick: bool) -> Iterator[Row]:
    from hexafix.benchmark.balls import speed_and_memory

    result = speed_and_memory(rounds=1 if quick else 3)
    detail = f"{result['seconds']:.3f} s against {result['pipeline_seconds']:.3f} s"
    yield _row("six balls in 512×512×600 over SimpleITK", result["ratio"], 0.15, "×", detail)
    yield _row("memory beyond the volume", result["extra_mb"], 64, "MB",
               f"SimpleITK {result['pipeline_extra_mb']:.0f} MB")  # fmt: skip


def _poses(quick: bool) -> Iterator[Row]:
    from hexafix.benchmark.recognition import exactness

    result = exactness(layouts=50 if quick else 1000)
    for method in ("least_squares", "groups"):
        worst = max(result[method].values())
        yield _row(f"ring pose on exact centres, {method}", worst, 1e-9, "mm, rad",
                   f"{result['layouts']} layouts")  # fmt: skip


def _kinematics(quick: bool) -> Iterator[Row]:
    from hexafix.benchmark.kinematics import round_trip, speed
    from hexafix.hardware import shipped_fixator

    fixator = shipped_fixator()
    result = speed(fixator, batch=1000 if quick else 10_000)
    other = f"scipy least_squares {result['least_squares_us']:.0f} µs"
    yield _row("forward kinematics, one", result["single_us"], 300, "µs", other)
    yield _row("forward kinematics, in a batch", result["batch_us"], 5, "µs each", other)
    trip = round_trip(fixator, poses=1000 if quick else 10_000)
    worst = max(trip["position_mm"], trip["single_mm"])
    yield _row("round trip with inverse kinematics", worst, 1e-9, "mm")


def _compensation(quick: bool) -> Iterator[Row]:
    from hexafix.benchmark.compensation import table

    for row in table(cases=2500 if not quick else 400):
        detail = ", ".join(
            f"{mode} {row[mode]['mm']:.3f} mm {row[mode]['deg']:.3f}°"
            for mode in ("none", "additive", "fused")
        )
        name = f"worst figure over its reference, {row['setting']}"
        yield _row(name, row["worst_ratio"], 1.15, "×", detail, low=0.85)


def _chain(quick: bool) -> Iterator[Row]:
    from hexafix.benchmark.chain import help_time, plan_time

    result = plan_time(quick=quick, rounds=1 if quick else 3)
    size = "×".join(map(str, result["size_ijk"]))
    yield _row(f"plan of {size} DICOM beyond reading", result["beyond_reading_s"], 3.0, "s",
               f"reading {result['read_s']:.2f} s, start {result['import_s']:.2f} s")  # fmt: skip
    yield _row("reading over SimpleITK's series reader", result["reading_ratio"], 1.0, "×",
               f"SimpleITK {result['simpleitk_read_s']:.2f} s")  # fmt: skip
    yield _row(f"phantom of {size}", result["phantom_s"], 60.0, "s")
    start = help_time(rounds=2 if quick else 7)
    yield _row("hexafix --help", start["help_s"], 0.3, "s", f"python {start['python_s']:.3f} s")


def _reading(quick: bool) -> Iterator[Row]:
    from hexafix.benchmark.reading import reading_time

    result = reading_time(
        size_ijk=(128, 128, 60) if quick else (512, 512, 600), rounds=1 if quick else 5
    )
    size = "×".join(map(str, result["size_ijk"]))
    yield _row(f"reading {size} DICOM over SimpleITK's series reader", result["ratio"], 1.0, "×",
               f"{result['hexafix_s']:.2f} s, SimpleITK {result['simpleitk_s']:.2f} s, "
               f"pydicom {result['pydicom_s']:.2f} s")  # fmt: skip


def _layouts(quick: bool) -> Iterator[Row]:
    from hexafix.benchmark.layouts import advice_time

    for count in (3, 4, 5):
        result = advice_time(count, rounds=2 if quick else 9)
        detail = (
            f"{result['compared']} shapes of {result['layouts']} layouts, one by one "
            f"{result['one_by_one_s']:.0f} s; both rings {result['pair_s']:.3f} s"
        )
        yield _row(f"advise {count} markers on 36 holes", result["ring_s"], 0.2, "s", detail)


def _selftest(quick: bool) -> Iterator[Row]:
    from hexafix.benchmark.selftest import self_test_time

    result = self_test_time(rounds=2 if quick else 7)
    detail = f"{result['checks']} checks pass, again {1000 * result['again_s']:.1f} ms"
    yield _row("self-test at the start of plan", result["first_s"], 0.25, "s", detail)


GROUPS: dict[str, Callable[[bool], Iterator[Row]]] = {
    "balls": _balls,
    "search": _search,
    "speed": _speed,
    "poses": _poses,
    "kinematics": _kinematics,
    "compensation": _compensation,
    "chain": _chain,
    "reading": _reading,
    "layouts": _layouts,
    "selftest": _selftest,
}
"""What can be measured, by name."""
