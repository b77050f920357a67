"""The correction row by row: where rings and fragment stand when the struts are set as printed."""

from __future__ import annotations

import datetime
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from hexafix.geometry import Pose
from hexafix.kinematics import forward_kinematics
from hexafix.pipeline.plan import Plan
from hexafix.report.scene import SceneGeometry, transform

Matrix = tuple[tuple[float, ...], ...]
"""A rigid 4×4 matrix by its rows, LPS mm."""


@dataclass(frozen=True)
class PlaybackRow:
    """One row of the schedule, set.

    Attributes
    ----------
    index : int
        From 0, today's readings.
    day : int
    date : datetime.date
    adjustment : int
    strut_mm : tuple of float
        Scale values, struts 1 to 6.
    turned_mm : tuple of float
        Change of each strut from the row before; 0 in row 0.
    proximal_lps, distal_lps : tuple of tuple of float, 4×4
        Ring poses, ring coordinates to LPS mm.
    fragment_lps : tuple of tuple of float, 4×4
        Moves the moving fragment from where the CT shows it, LPS mm.
    """

    index: int
    day: int
    date: datetime.date
    adjustment: int
    strut_mm: tuple[float, ...]
    turned_mm: tuple[float, ...]
    proximal_lps: Matrix
    distal_lps: Matrix
    fragment_lps: Matrix


@dataclass(frozen=True)
class Playback:
    """The whole correction.

    Attributes
    ----------
    rows : tuple of PlaybackRow
        One for each row of the schedule.
    moving : {'proximal', 'distal'}
        The fragment that moves with its ring; the other ring stays where the plan has it in the
        CT.
    """

    rows: tuple[PlaybackRow, ...]
    moving: Literal["proximal", "distal"]


def playback(plan: Plan) -> Playback:
    """Rings and moving fragment at every row of a plan's schedule.

    Notes
    -----
    The poses are those of the rounded scale values, by forward kinematics from row to row. The
    resting ring stands where image and readings together have it, as for the plan's own fragment
    motion, which the last row reaches but for the rounding.
    """
    fixator, compensation = plan.case.fixator, plan.struts.compensation
    moving = plan.motion.moving
    pose = today = plan.struts.forward.pose
    rows = []
    before = plan.schedule.rows[0].strut_mm
    for index, row in enumerate(plan.schedule.rows):
        lengths = np.asarray(row.strut_mm) + fixator.strut.scale_offset_mm
        pose = forward_kinematics(lengths, fixator, start=pose).pose if index else today
        if moving == "proximal":
            distal = compensation.distal
            proximal = distal @ pose
            motion = proximal @ (distal @ today).inverse()
        else:
            proximal = compensation.proximal
            distal = proximal @ pose.inverse()
            motion = distal @ (proximal @ today.inverse()).inverse()
        rows.append(
            PlaybackRow(
                index=index,
                day=row.day,
                date=row.date,
                adjustment=row.adjustment,
                strut_mm=row.strut_mm,
                # scale values have few decimals: the difference shall have no others
                turned_mm=tuple(
                    round(now - then, 9) for now, then in zip(row.strut_mm, before, strict=True)
                ),
                proximal_lps=_matrix(proximal),
                distal_lps=_matrix(distal),
                fragment_lps=_matrix(motion),
            )
        )
        before = row.strut_mm
    return Playback(tuple(rows), moving)


def scene_at(scene: SceneGeometry, row: PlaybackRow, moving: str) -> SceneGeometry:
    """The scene with rings and balls as they stand at one row; its bone is left out.

    Parameters
    ----------
    scene : SceneGeometry
        As the CT shows it, from `scene_of`.
    row : PlaybackRow
    moving : {'proximal', 'distal'}
        `Playback.moving`.
    """
    motion = np.array(row.fragment_lps)
    balls = tuple(
        replace(ball, center_mm=transform(motion, ball.center_mm)) if ball.ring == moving else ball
        for ball in scene.balls
    )
    return replace(
        scene,
        proximal_lps=np.array(row.proximal_lps),
        distal_lps=np.array(row.distal_lps),
        balls=balls,
        bone=None,
    )


def _matrix(pose: Pose) -> Matrix:
    return tuple(tuple(row) for row in pose.matrix.tolist())
