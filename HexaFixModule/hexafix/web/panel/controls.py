"""What the side panel asks of the views, and nothing else of them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Protocol

from hexafix.progress import Progress, silent


class TakenScene(Protocol):
    """A scene as it was when it was taken."""

    def write(self, path: Path, *, progress: Progress = silent) -> None:
        """Write it, on any thread, all or nothing; an error of the disk is raised."""
        ...


class ViewControls(Protocol):
    """The workstation's views as the side panel sees them; the panel answers clicks by name.

    The views call back `Panel.ball_clicked(index)` when a ball is clicked in a view and no point
    is asked for.
    """

    def select_ball(self, index: int | None) -> None:
        """Mark the ball (index into the found balls) in all views and bring the slices to it."""
        ...

    def place_marker(self, on: bool) -> None:
        """While on, the next click in a slice view adds a marker there."""
        ...

    def pick_point(self, picked: Callable[[Sequence[float]], None] | None) -> None:
        """Hand the next click's point (LPS, mm, three numbers) to `picked`; None ends it."""
        ...

    def drag_fragment(self, on: bool, moving: str = "") -> None:
        """Show or hide the handles that drag the bone fragment `moving`."""
        ...

    def show_playback_row(self, row: int | None) -> None:
        """Move frame and bone to a row of the schedule; None: back to what the CT shows."""
        ...

    def show_landmarks(
        self, moving: Sequence[Sequence[float]], fixed: Sequence[Sequence[float]]
    ) -> None:
        """Show landmark points (LPS, mm, n rows of 3 each)."""
        ...

    def take_scene(self) -> TakenScene:
        """The scene as it is now; a refusal is raised."""
        ...


class NoScene:
    """A scene of nothing: nothing is written."""

    def write(self, path: Path, *, progress: Progress = silent) -> None:
        """Take the path."""


class NoViews:
    """Controls of a workstation without views: everything is taken and nothing shown."""

    def select_ball(self, index: int | None) -> None:
        """Take a selection."""

    def place_marker(self, on: bool) -> None:
        """Take the mode."""

    def pick_point(self, picked: Callable[[Sequence[float]], None] | None) -> None:
        """Take the wish for a point; none will come."""

    def drag_fragment(self, on: bool, moving: str = "") -> None:
        """Take the mode."""

    def show_playback_row(self, row: int | None) -> None:
        """Take a row."""

    def show_landmarks(
        self, moving: Sequence[Sequence[float]], fixed: Sequence[Sequence[float]]
    ) -> None:
        """Take the points (LPS, mm, n rows of 3 each)."""

    def take_scene(self) -> TakenScene:
        """A scene of nothing."""
        return NoScene()
