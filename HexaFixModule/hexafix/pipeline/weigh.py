"""The readings beside the CT, strut by strut, before there is a correction."""

from __future__ import annotations

from typing import Any

import numpy as np

from hexafix import gates
from hexafix.case import Case
from hexafix.errors import HexaFixError, InputError
from hexafix.gates import STRUT_LIMIT_MM, STRUT_WARNING_MM
from hexafix.kinematics import forward_kinematics, second_starts, strut_lengths
from hexafix.pipeline.numbers import pose_document, rounded
from hexafix.pipeline.recognised import Recognised
from hexafix.pipeline.strut_witness import compare_struts


def weigh_document(case: Case, recognised: Recognised) -> dict[str, Any]:
    """What the strut readings say against the CT; the same gates as a plan asks.

    Parameters
    ----------
    case : Case
        With readings; correction and schedule are not needed.
    recognised : Recognised

    Returns
    -------
    dict
        ``struts``: for each strut its reading, its length by reading and by CT, CT minus reading
        and a ``verdict`` (``agrees``, ``read-again``, ``disagrees``); ``better_order`` of the
        readings in words or None; ``difference_mm``, ``difference_deg`` of the mechanism's pose by
        CT from that by struts; ``from_struts``, that pose, or None; ``gates`` (G6, G8); ``faults``
        of what refuses; ``agree``.

    Raises
    ------
    InputError
        If the case has no readings.
    """
    if case.strut_readings_mm is None:
        raise InputError.of(
            "needed-for-a-plan",
            "a plan needs this part of the case",
            where="strut_readings_mm",
            next_step="read the six struts, in millimetres",
        )
    readings, seen, fixator = case.strut_readings_mm, recognised.mechanism.pose, case.fixator
    lengths = readings + fixator.strut.scale_offset_mm
    witness = compare_struts(seen, fixator, lengths_mm=lengths)
    found = [gates.struts_agree(witness.differences_mm, better_order=witness.better_order)]
    document: dict[str, Any] = {
        "schema_version": 1,
        "struts": [
            {
                "strut": k + 1,
                "reading_mm": float(reading),
                "length_mm": rounded(length),
                "ct_length_mm": rounded(by_ct),
                "difference_mm": rounded(difference),
                "verdict": _verdict(float(difference)),
            }
            for k, (reading, length, by_ct, difference) in enumerate(
                zip(
                    readings,
                    lengths,
                    strut_lengths(seen, fixator),
                    witness.differences_mm,
                    strict=True,
                )
            )
        ],
        "better_order": witness.better_order,
        "difference_mm": None,
        "difference_deg": None,
        "from_struts": None,
    }
    faults = []
    try:
        forward = forward_kinematics(lengths, fixator, start=seen).pose
        basin = second_starts(lengths, fixator, solution=forward)
    except HexaFixError as error:
        faults += error.faults
    else:
        distance, angle = seen.difference(forward)
        found += gates.recognition_error(distance, angle)
        found.append(gates.forward_basin(basin.worst_mm if basin.agree else np.inf, basin.count))
        document["difference_mm"] = rounded(distance)
        document["difference_deg"] = rounded(float(np.degrees(angle)))
        document["from_struts"] = pose_document(forward)
    faults = [*(gate.as_fault() for gate in gates.red(found)), *faults]
    document["gates"] = [gate.as_json() for gate in found]
    document["faults"] = [fault.as_json() for fault in faults]
    document["agree"] = not faults
    return document


def _verdict(difference_mm: float) -> str:
    """One strut against the limits of G6."""
    if abs(difference_mm) > STRUT_LIMIT_MM:
        return "disagrees"
    return "read-again" if abs(difference_mm) > STRUT_WARNING_MM else "agrees"
