"""What every door asks of the scene: values of the chain in, nodes out, and back."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from hexafix import export
from hexafix.case import Case
from hexafix.hardware import MarkerLayout
from hexafix.imaging import Volume
from hexafix.markers import BallSet
from hexafix.mrml import (
    bundle,
    fragments,
    frame,
    hierarchy,
    markups,
    models,
    parameter_node,
    tables,
)
from hexafix.mrml import transforms as places
from hexafix.mrml import volume as volumes
from hexafix.mrml.geometry import motion_of_vtk, ras_points, require_rigid, vtk_of_motion
from hexafix.mrml.nodes import find, remove
from hexafix.progress import Progress, silent
from hexafix.report.scene import BoneSample, SceneGeometry

if TYPE_CHECKING:
    from hexafix.pipeline import Plan, Playback, Recognised

GROUPS = {
    "volume": ("volume",),
    "balls": ("markups/proximal", "markups/distal", "markups/unnumbered", "markups/rejected",
              "model/balls"),
    "frame": ("transform/ring", "model/ring", "model/strut", "markups/frame"),
    "bone": ("model/bone", "transform/fragment"),
    "target": ("transform/target", "model/target"),
    "landmarks": ("markups/landmarks",),
    "plan": ("table",),
    "case": ("parameters",),
}  # fmt: skip
"""What can be cleared, hidden or shown grey, and the roles that it stands for."""


class SceneLogic:
    """Brings the values of the chain into a scene.

    Parameters
    ----------
    scene : vtkMRMLScene
        Of slicer-core alone, trame-slicer or desktop Slicer.
    app_logic : vtkSlicerApplicationLogic, optional
        Tells the slice views of a newly loaded volume.
    """

    def __init__(self, scene: Any, *, app_logic: Any = None) -> None:
        self.scene = scene
        self.app_logic = app_logic
        self._geometry: SceneGeometry | None = None

    # ------------------------------------------------------------- image

    def add_volume(self, volume: Volume, name: str = "CT") -> Any:
        """A volume node with the CT, shown in the slice views; an older one of ours goes."""
        remove(self.scene, volumes.VOLUME_ROLE)
        node = volumes.add_volume(self.scene, volume, name)
        volumes.set_window(node, window_hu=volumes.WINDOW_HU, level_hu=volumes.LEVEL_HU)
        if self.app_logic is not None:
            self.app_logic.GetSelectionNode().SetActiveVolumeID(node.GetID())
            self.app_logic.PropagateVolumeSelection()
        return node

    def volume_node(self) -> Any | None:
        """The CT's node, None before one is loaded."""
        return find(self.scene, volumes.VOLUME_ROLE)

    def volume_of(self, node: Any) -> Volume:
        """The CT of a scalar volume node; refused where its place cannot be trusted (H36)."""
        return volumes.volume_of(node)

    # ------------------------------------------------------------- balls

    def show_balls(
        self,
        balls: BallSet,
        judged: Mapping[str, Any] | None,
        layouts: Mapping[str, MarkerLayout | Iterable[int]],
    ) -> dict[str, Any]:
        """Show the balls found, by ring and number as far as they are known.

        Parameters
        ----------
        balls : BallSet
        judged : mapping or None
            `pipeline.judge_numbering`'s document; None: no numbers yet.
        layouts : mapping of str
            Layout, or numbers alone, of ``proximal`` and ``distal``.

        Returns
        -------
        dict
            Markups nodes by list: proximal, distal, unnumbered, rejected.
        """
        lists = markups.sort_balls(balls, judged, layouts)
        nodes = markups.show_lists(self.scene, lists)
        frame.show_ball_models(self.scene, balls, lists)
        return nodes

    def show_rejected(self, shown: bool) -> None:
        """Show or hide the candidates that are no balls."""
        models.set_shown(self.scene, ("markups/rejected",), shown)

    def ball_at(self, point_lps_mm: Sequence[float], *, within_mm: float = 8.0) -> int | None:
        """The index of the ball found nearest to a point, LPS mm; None if none is near."""
        return markups.nearest_ball(self.scene, point_lps_mm, within_mm=within_mm)

    def select_ball(self, index: int | None) -> list[float] | None:
        """Mark a ball by a bigger glyph, and say where it is, LPS mm; None unmarks."""
        return markups.select(self.scene, index)

    def save_bundle(self, path: Path) -> None:
        """Save our nodes as a scene bundle (``.mrb``) that names nobody."""
        bundle.save_bundle(self.scene, path)

    def take_bundle(self) -> bundle.TakenBundle:
        """The same as it is now, to be written on any thread."""
        return bundle.TakenBundle(self.scene)

    def open_bundle(self, path: Path) -> None:
        """Replace our nodes by those of a bundle; a refused one leaves the scene as it was."""
        bundle.open_bundle(self.scene, path)
        self._geometry = None

    def show_landmarks(
        self, moving: Sequence[Sequence[float]], fixed: Sequence[Sequence[float]]
    ) -> None:
        """Show landmarks, LPS mm, n rows of 3: m1, m2, … of the moving, f1, f2, … of the other."""
        markups.show_landmarks(self.scene, moving, fixed)

    # ------------------------------------------------------------- frame and bone

    def show_recognised(self, case: Case, recognised: Recognised) -> None:
        """Show rings, joints, struts and axes where the CT shows them."""
        from hexafix.pipeline import scene_of

        self._geometry = scene_of(case, recognised, bone=False)
        frame.show_frame(self.scene, self._geometry)
        self.show_playback_row(None, None)
        hierarchy.arrange(self.scene, case.case_id)

    def show_fragments(self, samples: Mapping[str, BoneSample], moving: str) -> None:
        """Show both bone fragments; `moving` follows the playback, its ghost the target."""
        fragments.show_fragments(self.scene, samples, moving)

    def show_target(self, fragment_lps: Any, moving: str) -> None:
        """Show where fragment and ring shall end.

        Parameters
        ----------
        fragment_lps : array_like, shape (4, 4)
            Moves points of the moving fragment, LPS mm.
        moving : str
            ``proximal`` or ``distal``.
        """
        fragments.show_target(self.scene, self._shown_geometry(), fragment_lps, moving)

    def drag_fragment(self, on: bool) -> None:
        """Show or hide the handles that drag the target of the moving fragment."""
        fragments.set_handles(self.scene, on)

    def fragment_motion_lps(self) -> list[list[float]]:
        """The wished motion of the moving fragment, 4×4, as the user dragged it: LPS, mm.

        Raises
        ------
        Refused
            If the transform is not rigid (H36).
        """
        node = find(self.scene, places.TARGET)
        if node is None:
            return [[float(i == j) for j in range(4)] for i in range(4)]
        world = vtk_of_motion(places.motion_lps(node))
        node.GetMatrixTransformToWorld(world)
        return require_rigid(motion_of_vtk(world), what="wished motion of the fragment").tolist()

    def show_playback_row(self, playback: Playback | None, index: int | None) -> None:
        """Move frame and bone to a row of the schedule; None: where the CT shows them."""
        geometry = self._shown_geometry()
        if geometry is not None:
            row = None if playback is None or index is None else playback.rows[index]
            moving = None if playback is None else playback.moving
            frame.show_moment(self.scene, geometry, row, moving)

    def _shown_geometry(self) -> SceneGeometry | None:
        """Rings as the CT shows them, of a scene that was opened too; None before there are any."""
        if self._geometry is None:
            self._geometry = frame.stored_geometry(self.scene)
        return self._geometry

    # ------------------------------------------------------------- plan

    def show_schedule(self, plan: Plan) -> Any:
        """Show the strut schedule as a table; returns its node."""
        from hexafix.pipeline import plan_document_of

        return tables.put_strut_table(self.scene, plan_document_of(plan))

    def show_plan(self, case: Case, plan: Plan) -> None:
        """Show the frame, where the fragment shall end, and the strut schedule as a table."""
        self.show_recognised(case, plan.recognised)
        asked = (case.document["correction"] or {}).get("matrix_lps")
        # Of a fragment motion what was asked for: a bone dragged twice must not creep.
        self.show_target(asked or plan.motion.motion.matrix, plan.motion.moving)
        self.show_schedule(plan)
        hierarchy.arrange(self.scene, case.case_id)

    def plan(
        self,
        volume_node: Any,
        case: Case,
        folder: Path,
        *,
        accept_relaxed_layout: bool = False,
        progress: Progress = silent,
    ) -> dict[str, Any]:
        """Volume node in, nodes and export out: the whole chain, byte for byte `hexafix plan`'s.

        Parameters
        ----------
        volume_node : vtkMRMLScalarVolumeNode
        case : Case
        folder : Path
            Where the export goes, all or nothing.
        accept_relaxed_layout : bool
        progress : Progress, optional

        Returns
        -------
        dict
            The plan document, as ``plan.json`` holds it.

        Raises
        ------
        Refused
            If the volume or a gate refuses; then no file is written and no node is changed.
        """
        from hexafix import pipeline

        folder = Path(folder)
        export.check_target(folder)
        plan = pipeline.plan_correction(
            case,
            volume=self.volume_of(volume_node),
            accept_relaxed_layout=accept_relaxed_layout,
            progress=progress,
        )
        prescription = pipeline.prescribe(plan, progress=progress)
        pipeline.write_prescription(prescription, folder)
        self._show_all(volume_node, case, plan, accept_relaxed_layout)
        return prescription.document

    def _show_all(self, volume_node: Any, case: Case, plan: Plan, accepted: bool) -> None:
        from hexafix import pipeline

        volumes.adopt(self.scene, volume_node)
        recognised = plan.recognised
        ball_of = recognised.numbering.ball_of_number
        judged = {"assigned": {str(number): index for number, index in ball_of.items()}}
        self.show_balls(
            recognised.balls, judged, {"proximal": case.proximal, "distal": case.distal}
        )
        self.show_plan(case, plan)
        self.show_fragments(pipeline.bone_fragments(recognised), plan.motion.moving)
        self.save_case_into(case, inputVolume=volume_node, acceptRelaxedLayout=accepted)
        hierarchy.arrange(self.scene, case.case_id)

    # ------------------------------------------------------------- the case

    def save_case_into(
        self, case: Case | Mapping[str, Any], *, case_sha256: str | None = None, **shell: Any
    ) -> Any:
        """Put the case, or a draft of its document, into the parameter node.

        Parameters
        ----------
        case : Case or mapping
        case_sha256 : str, optional
            Hash of the case file that a draft is the content of.
        **shell
            Other fields of `parameter_node.ShellParameters`, by name.
        """
        shell.setdefault("inputVolume", self.volume_node())
        return parameter_node.store_case(self.scene, case, case_sha256=case_sha256, **shell)

    def case_from_scene(self, *, plannable: bool = True) -> Case:
        """The case that the scene holds, checked as a case file is."""
        return parameter_node.stored_case(self.scene, plannable=plannable)

    def case_document_from_scene(self) -> dict[str, Any] | None:
        """The case document that the scene holds, draft or whole; None if it holds none."""
        return parameter_node.stored_document(self.scene)

    # ------------------------------------------------------------- all of it

    def arrange(self, case_id: str) -> None:
        """Sort the nodes into patient, study and folders, named by the pseudonym."""
        hierarchy.arrange(self.scene, case_id)

    def clear(self, what: str = "all") -> None:
        """Remove one of `GROUPS`, or ``all`` nodes of ours."""
        if what in ("all", "frame"):
            self._geometry = None
        for role in GROUPS[what] if what != "all" else ("",):
            remove(self.scene, role)

    def set_stale(self, what: str, stale: bool) -> None:
        """Show one of `GROUPS` grey because its inputs were edited (H40), or in colour again."""
        models.set_stale(self.scene, GROUPS[what], stale)

    def set_shown(self, what: str, shown: bool) -> None:
        """Show or hide one of `GROUPS`."""
        models.set_shown(self.scene, GROUPS[what], shown)

    @staticmethod
    def ras_from_lps(point_lps_mm: Sequence[float]) -> list[float]:
        """A point, LPS mm, for a view, RAS mm."""
        return ras_points(point_lps_mm).tolist()
