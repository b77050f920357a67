"""What the presenter asks of the pipeline; tests give fakes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from importlib import import_module
from pathlib import Path
from typing import Any, Protocol, cast

from hexafix.case import Case, CaseParts
from hexafix.progress import Progress


class Engine(Protocol):
    """The functions of `hexafix.pipeline` that the workflow is made of."""

    # What each does stands there; here only what the presenter passes.
    # ruff: noqa: D102

    def image_series(self, path: Path, *, progress: Progress = ...) -> dict[str, Any]: ...

    def read_image(
        self, path: Path, *, series_instance_uid: str | None = ..., progress: Progress = ...
    ) -> Any: ...

    def image_document(self, volume: Any) -> dict[str, Any]: ...

    def find_case_balls(
        self,
        volume: Any,
        *,
        ball_diameter_mm: float,
        added_lps_mm: Sequence[Any] = ...,
        removed_lps_mm: Sequence[Any] = ...,
        found: Any = ...,
        progress: Progress = ...,
    ) -> Any: ...

    def balls_document(self, balls: Any) -> dict[str, Any]: ...

    def with_ball_added(
        self, edits: Mapping[str, Any], *, lps_mm: Sequence[float]
    ) -> dict[str, Any]: ...

    def with_ball_removed(
        self, edits: Mapping[str, Any], *, ball: Mapping[str, Any]
    ) -> dict[str, Any]: ...

    def judge_case_numbering(self, case: CaseParts, balls: Any) -> dict[str, Any]: ...

    def recognise_checked(
        self,
        case: Case,
        *,
        volume: Any = ...,
        balls: Any = ...,
        accept_relaxed_layout: bool = ...,
        progress: Progress = ...,
    ) -> Any: ...

    def recognition_document(self, case: Case, recognised: Any) -> dict[str, Any]: ...

    def layout_document(self, proximal: Any, distal: Any) -> dict[str, Any]: ...

    def layout_pictures(self, proximal: Any, distal: Any) -> dict[str, str]: ...

    def weigh_document(self, case: Case, recognised: Any) -> dict[str, Any]: ...

    def preview_target(self, case: Case, recognised: Any) -> dict[str, Any]: ...

    def plan_recognised(
        self, case: Case, recognised: Any, *, accept_relaxed_layout: bool = ...
    ) -> Any: ...

    def plan_document_of(self, plan: Any) -> dict[str, Any]: ...

    def prescribe(self, plan: Any, *, progress: Progress = ...) -> Any: ...

    def write_prescription(self, prescription: Any, folder: Path) -> Any: ...

    def playback(self, plan: Any) -> Any: ...

    def pictures(self, document: Mapping[str, Any]) -> dict[str, str]: ...


def pipeline_engine() -> Engine:
    """The real pipeline; loaded when first asked for, since it brings the mathematics."""
    return cast(Engine, import_module("hexafix.pipeline"))
