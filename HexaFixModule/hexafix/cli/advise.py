"""The ``advise`` command: the best marker layouts of a ring's free holes."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, Literal

from cyclopts import Parameter

from hexafix.errors import InputError


def advise(
    ring_or_case: Annotated[
        Path | None, Parameter(help="A case, layout, ring or hardware file; none: a bare ring.")
    ] = None,
    *,
    n: Annotated[int | None, Parameter(name="--n", help="Markers a ring, 3 to 5.")] = None,
    holes: Annotated[int | None, Parameter(help="Holes of the circle (36).")] = None,
    radius_mm: Annotated[
        float | None, Parameter(help="Radius of the balls on the circle (100).")
    ] = None,
    offset_deg: Annotated[float | None, Parameter(help="Sweep angle of hole 1 (0).")] = None,
    heights_mm: Annotated[str | None, Parameter(help="Heights the rods allow, e.g. 20,45.")] = None,
    occupied: Annotated[
        str | None, Parameter(help="Taken holes, counted from 1, e.g. 1,5; of the proximal ring.")
    ] = None,
    occupied_distal: Annotated[
        str | None, Parameter(help="Taken holes of the distal ring.")
    ] = None,
    only: Annotated[
        Literal["proximal", "distal"] | None,
        Parameter(help="Advise this ring; the other keeps its layout."),
    ] = None,
    relaxed: Annotated[bool, Parameter(negative="", help="Allow the relaxed angle rule.")] = False,
    margin_mm: Annotated[
        float | None, Parameter(help="Smallest RMS of a wrong numbering (8, at least 5).")
    ] = None,
    top: Annotated[int, Parameter(help="How many layouts to list.")] = 5,
    picture: Annotated[Path | None, Parameter(help="SVG file to write.")] = None,
    json: Annotated[bool, Parameter(negative="", help="Print one JSON document.")] = False,
) -> int:
    """Rank the marker layouts of the free holes by predicted error; a case's rings together."""
    from hexafix.case import Rings, load_rings
    from hexafix.cli.console import print_json
    from hexafix.pipeline.layout import HoleOptions, advice_document, advise_layouts

    bare = Rings(("ring",), (None,), (None,))
    rings = bare if ring_or_case is None else load_rings(ring_or_case)
    taken = [(rings.names[0], occupied), (rings.names[-1], occupied_distal)]
    options = HoleOptions.in_degrees(
        count=holes,
        radius_mm=radius_mm,
        offset_deg=offset_deg,
        heights_mm=_numbers(heights_mm, "--heights-mm", float),
        occupied={name: _numbers(text, "--occupied", int) for name, text in taken if text},
    )
    advice = advise_layouts(
        rings, count=n, holes=options, only=only, top=top, relaxed=relaxed, margin_mm=margin_mm
    )
    if picture is not None:
        _write_picture(advice, picture)
    document = advice_document(advice)
    print_json(document) if json else print(advice_text(document))
    return 0


def advice_text(document: dict[str, Any]) -> str:
    """What is weak now, and the layouts in the order of their error."""
    lines = []
    for name, ring in document["rings"].items():
        now = ring["present"]
        if now is not None:
            lines.append(f"{name}, now: {_figures(now)}")
            lines += [f"  weaker: {weakness['words']}" for weakness in ring["weaker_because"]]
        if ring["fewest_moves"] is not None:
            fewest = ring["fewest_moves"]
            lines.append(f"  mended by the fewest moves: {'; '.join(fewest['moves'])}")
            lines.append(f"    {_figures(fewest)}")
        if not ring["mirror_shown"]:
            lines.append(
                f"{name}: no layout of these places and markers can show a mirrored image;"
                " four markers at two heights would"
            )
    if document["keep_present"]:
        lines.append("keep the present layout: nothing listed is better")
    for proposal in document["advised"]:
        head = f"{proposal['rank']}. error {proposal['error_mm']:.3f} mm at joints and bone"
        if proposal["exchange_mm"] is not None:
            head += f", rings apart by RMS {proposal['exchange_mm']:.1f} mm"
        lines.append(head)
        for name, ring in proposal["rings"].items():
            places = "  ".join(
                f"{m['number']}: hole {m['hole']} ({m['sweep_deg']:g} deg, {m['height_mm']:g} mm)"
                for m in ring["markers"]
            )
            lines += [f"   {name}  {places}", f"      {_figures(ring)}"]
            if ring["moves"]:
                lines.append("      move " + "; ".join(ring["moves"]))
    return "\n".join(lines)


def _figures(ring: dict[str, Any]) -> str:
    angles = "/".join(f"{angle:g}" for angle in ring["included_angles_deg"])
    words = f"angles {angles} deg ({ring['rule']})"
    if ring["error_mm"] is not None:
        words += (
            f", error {ring['error_mm']:.3f} mm (joints {ring['joints_mm']:.3f}, bone"
            f" {ring['bone_mm']:.3f}; Eq. 28 {ring['predicted_error_mm']:.3f} mm and"
            f" {ring['predicted_error_deg']:.3f} deg)"
        )
    return (
        f"{words}, next numbering {ring['uniqueness_mm']:.1f} mm away, mirror"
        f" {ring['mirror_mm']:.1f} mm"
    )


def _write_picture(advice: Any, path: Path) -> None:
    from hexafix.report.layout_picture import layout_picture

    if path.suffix.lower() != ".svg":
        raise InputError.of(
            "picture-format",
            "the picture is an SVG file",
            limit=".svg",
            where="--picture",
            next_step="end the file's name with .svg",
        )
    try:
        path.write_text(layout_picture(advice), encoding="utf-8")
    except OSError as error:
        raise InputError.of(
            "picture-unwritable",
            f"the picture cannot be written: {error.strerror}",
            where="--picture",
            next_step="name a file in a folder that exists",
        ) from error


def _numbers(text: str | None, option: str, kind: type) -> tuple | None:
    """``1,5`` as numbers."""
    if text is None:
        return None
    try:
        return tuple(kind(part) for part in text.split(","))
    except ValueError as error:
        raise InputError.of(
            "option-value",
            "numbers with commas between them are needed",
            where=option,
            next_step=f"write e.g. {option} 20,45",
        ) from error
