"""The values of the chain as JSON documents: what the command line prints and the export holds."""

from __future__ import annotations

from typing import Any

import numpy as np

from hexafix.case import Case
from hexafix.imaging import Volume
from hexafix.markers import BallSet
from hexafix.pipeline.numbers import covariance_document, pose_document, rounded
from hexafix.pipeline.recognised import Recognised
from hexafix.recognition import RingPose


def recognition(case: Case, recognised: Recognised) -> dict[str, Any]:
    """What ``hexafix recognise`` prints; the same keys stand in ``plan.json``."""
    numbering = recognised.numbering
    balls = recognised.balls.balls
    ball_of = numbering.ball_of_number
    return {
        "schema_version": 1,
        "frame": "LPS",
        "case_id": case.case_id,
        "limb": {"side": case.limb.side, "bone": case.limb.bone},
        "image": _image(recognised),
        "balls": _numbered_balls(case, recognised),
        "rejected": rejected(recognised.balls),
        "unused_balls": [
            {"center_mm": rounded(balls[index].center_mm)} for index in numbering.unused
        ],
        "numbering": {
            str(number): rounded(balls[index].center_mm) for number, index in ball_of.items()
        },
        "numbering_settled_by": numbering.settled_by,
        "numbering_margin_mm": rounded(numbering.margin_mm),
        "numbering_alternatives": [
            {"choice": other.words, "rms_mm": rounded(other.rms_mm)}
            for other in numbering.alternatives[:6]
        ],
        "rings": {
            "proximal": _ring(recognised.proximal, recognised.proximal_by_groups),
            "distal": _ring(recognised.distal, recognised.distal_by_groups),
        },
        "mechanism": {
            **pose_document(recognised.mechanism.pose),
            **covariance_document(recognised.mechanism.covariance),
            "covariance_frame": "proximal ring",
        },
        "gates": [gate.as_json() for gate in recognised.gates],
    }


def rejected(balls: BallSet) -> list[dict[str, Any]]:
    """Candidates that are no marker balls, each with the predicate it failed."""
    return [
        {"center_mm": rounded(other.center_mm, 3), "reason": other.reason}
        for other in balls.rejected
    ]


def found_balls(balls: BallSet) -> dict[str, Any]:
    """What ``hexafix markers`` prints."""
    return {
        "schema_version": 1,
        "frame": "LPS",
        "balls": [_ball(ball) for ball in balls.balls],
        "rejected": rejected(balls),
        "warnings": list(balls.warnings),
    }


def _ball(ball: Any) -> dict[str, Any]:
    return {
        "center_mm": rounded(ball.center_mm),
        "diameter_mm": rounded(ball.diameter_mm),
        "sigma_mm": rounded(ball.sigma_mm),
        "covariance_mm2": rounded(ball.covariance_mm2, 12),
        "rms_residual_mm": rounded(ball.rms_residual_mm),
        "core_hu": rounded(ball.core_hu, 1),
        "method": ball.method,
        "warnings": list(ball.warnings),
        **({"added": True} if ball.added else {}),
    }


def _numbered_balls(case: Case, recognised: Recognised) -> list[dict[str, Any]]:
    ball_of = recognised.numbering.ball_of_number
    return [
        {"number": number, "ring": ring, **_ball(recognised.balls.balls[ball_of[number]])}
        for ring, layout in (("proximal", case.proximal), ("distal", case.distal))
        for number in layout.numbers
    ]


def _image(recognised: Recognised) -> dict[str, Any]:
    source = recognised.volume.source
    return {
        **image_content(recognised.volume),
        "warnings": [*source.warnings, *recognised.balls.warnings],
    }


def image_content(volume: Volume) -> dict[str, Any]:
    """What an image is, without its warnings."""
    acquired = volume.source.acquisition
    return {
        "frame": "LPS",
        "kind": volume.source.kind,
        "sha256": volume.source.sha256,
        "size_ijk": list(volume.size_ijk),
        "spacing_mm": rounded(volume.spacing_mm, 6),
        "ijk_to_lps": rounded(volume.ijk_to_lps, 9),
        "resampled": acquired is not None,
        "gantry_tilt_deg": None if acquired is None else rounded(acquired.tilt_deg, 4),
    }


def _ring(ring: RingPose, by_groups: RingPose) -> dict[str, Any]:
    pose = pose_document(ring.pose)
    groups = pose_document(by_groups.pose)
    distance, angle = ring.pose.difference(by_groups.pose)
    return {
        "matrix_lps": pose.pop("matrix"),
        **pose,
        "rms_mm": rounded(ring.rms_mm),
        "residuals_mm": rounded(ring.residuals_mm),
        "method": ring.method,
        **covariance_document(ring.covariance),
        "covariance_frame": "ring",
        "group_method": {
            "position_mm": groups["position_mm"],
            "angles_deg": groups["angles_deg"],
            "difference_mm": rounded(distance),
            "difference_deg": rounded(float(np.degrees(angle))),
        },
    }
