"""One slice of the CT with the balls and rings it meets."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

from hexafix.qt.kit import kit, views
from hexafix.surfaces import (
    SliceView,
    at_place,
    cut,
    half_height_mm,
    in_slice,
    look_at_slice,
    nearest_place,
    slice_places_mm,
)

if TYPE_CHECKING:
    from hexafix.qt.shown import Outline, ShownBalls

GROUND = (0.0, 0.0, 0.0)
INK = (1.0, 0.92, 0.55)
CROSS = (0.35, 0.85, 1.0)

LABEL_REACH_MM = 6.0
"""A ball's number is written in the slices that are this near to its centre."""


class SlicePane:
    """A slice view with its slider, in patient axes.

    Parameters
    ----------
    view : SliceView
    clicked : callable
        Called with the LPS point of a click.
    shared : vtkImageProperty
        Window and level, the same in all slices.
    regrey : callable
        Called when window or level was changed in this view.
    """

    def __init__(
        self,
        view: SliceView,
        *,
        clicked: Callable[[tuple[float, float, float]], None],
        shared: Any,
        regrey: Callable[[], None],
    ) -> None:
        from vtkmodules.vtkRenderingCore import vtkRenderer

        q = kit()
        self.view, self._clicked, self._shared, self._regrey = view, clicked, shared, regrey
        self.places: tuple[float, ...] = ()
        self.point = (0.0, 0.0, 0.0)
        self._volume: Any = None
        self._slice: Any = None
        self._balls: ShownBalls | None = None
        self._outlines: Mapping[str, Outline] = {}
        self._over: list[Any] = []
        self.frame = q.QWidget()
        self.frame.setObjectName(f"{view.name}View")
        self.interactor = views().QVTKRenderWindowInteractor(self.frame)
        self.interactor.setAccessibleName(f"{view.title} slice")
        self.slider = q.QSlider(q.Qt.Vertical)
        self.slider.setObjectName(f"{view.name}Slider")
        self.slider.setAccessibleName(f"{view.title} slice, place")
        self.slider.setEnabled(False)
        self.title = q.QLabel(f"<b>{view.title}</b>")
        self._lay_out(q)
        self.renderer = vtkRenderer()
        self.renderer.SetBackground(*GROUND)
        self.window = self.interactor.GetRenderWindow()
        self.window.SetMultiSamples(0)
        self.window.AddRenderer(self.renderer)
        self._texts = self._edge_letters()
        self._cross = self._crosshair()
        self._listen()
        self.slider.valueChanged.connect(self._slid)
        self.interactor.Initialize()

    def _lay_out(self, q: Any) -> None:
        across = q.QHBoxLayout()
        across.addWidget(self.interactor, 1)
        across.addWidget(self.slider)
        down = q.QVBoxLayout(self.frame)
        down.setContentsMargins(2, 2, 2, 2)
        down.setSpacing(1)
        down.addWidget(self.title)
        down.addLayout(across, 1)

    # ------------------------------------------------------------ content

    def show_volume(self, volume: Any, image: Any, matrix: Any) -> None:
        """Show a volume; `image` and `matrix` come from `surfaces.slice_image`."""
        from vtkmodules.vtkRenderingCore import vtkImageSlice
        from vtkmodules.vtkRenderingImage import vtkImageResliceMapper

        self.clear()
        mapper = vtkImageResliceMapper()
        mapper.SetInputData(image)
        mapper.SliceFacesCameraOn()
        mapper.SliceAtFocalPointOn()
        mapper.ResampleToScreenPixelsOn()
        actor = vtkImageSlice()
        actor.SetMapper(mapper)
        actor.SetProperty(self._shared)
        actor.SetUserMatrix(matrix)
        actor.PickableOff()
        self.renderer.AddViewProp(actor)
        self._volume, self._slice = volume, actor
        self.places = slice_places_mm(volume, self.view)
        self.slider.blockSignals(True)
        self.slider.setRange(0, len(self.places) - 1)
        self.slider.setEnabled(True)
        self.slider.blockSignals(False)

    def fit(self) -> None:
        """Show the whole slice."""
        if self._volume is not None:
            camera = self.renderer.GetActiveCamera()
            aspect = max(1, self.interactor.width()) / max(1, self.interactor.height())
            height = half_height_mm(self._volume, self.view, aspect=aspect)
            camera.SetParallelScale(height)
            self._place()

    def clear(self) -> None:
        """Show nothing."""
        if self._volume is not None:
            self.renderer.RemoveViewProp(self._slice)
            self._volume, self._slice, self.places = None, None, ()
            self.slider.setEnabled(False)
        self._remove_overlays()

    def go_to(self, point: tuple[float, float, float]) -> None:
        """Show the slice through a point in LPS mm, and mark the point."""
        self.point = point
        if self.places:
            self.slider.blockSignals(True)
            self.slider.setValue(nearest_place(self.places, point[self.view.axis]))
            self.slider.blockSignals(False)
            self._place()

    def show_balls(self, balls: ShownBalls | None) -> None:
        """Circle the balls and write their numbers."""
        self._balls = balls

    def show_outlines(self, outlines: Mapping[str, Outline]) -> None:
        """Draw where rings are cut by the slice."""
        self._outlines = outlines

    def place_mm(self) -> float:
        """Where the slice lies along its axis."""
        return self.places[self.slider.value()] if self.places else 0.0

    # ------------------------------------------------------------ drawing

    def _slid(self, _: int) -> None:
        self.point = at_place(self.view, self.point, self.place_mm())
        self._place()
        self.render()

    def _place(self) -> None:
        if not self.places:
            return
        place = self.place_mm()
        camera = self.renderer.GetActiveCamera()
        here = at_place(self.view, self._looked_at(camera), place)
        look_at_slice(camera, self.view, here)
        self._cross.SetPosition(*at_place(self.view, self.point, place))
        self._cross.VisibilityOn()
        sign = self.view.letter
        self.title.setText(f"<b>{self.view.title}</b> {sign} {place:.1f} mm")
        self._draw_overlays(place)

    def _looked_at(self, camera: Any) -> tuple[float, float, float]:
        """Where the view is panned to; the image's middle at first."""
        from hexafix.surfaces import middle_mm

        if getattr(self, "_seen", None) is not self._volume:
            self._seen = self._volume
            return middle_mm(self._volume)
        return camera.GetFocalPoint()

    def _remove_overlays(self) -> None:
        for actor in self._over:
            self.renderer.RemoveViewProp(actor)
        self._over = []

    def _draw_overlays(self, place: float) -> None:
        self._remove_overlays()
        for outline in self._outlines.values():
            self._line(cut(outline.mesh, self.view, place), outline.colour, 2.0)
        balls = self._balls
        if balls is None:
            return
        self._line(cut(balls.mesh, self.view, place), balls.colour, 2.0)
        near = in_slice(balls.centers_mm, view=self.view, place_mm=place, reach_mm=LABEL_REACH_MM)
        for index in near:
            where = at_place(self.view, balls.centers_mm[index], place)
            self._write(balls.labels[index], where)

    def _line(self, lines: Any, colour: tuple[float, ...], width: float) -> None:
        from vtkmodules.vtkRenderingCore import vtkActor, vtkPolyDataMapper

        mapper = vtkPolyDataMapper()
        mapper.SetInputData(lines)
        mapper.ScalarVisibilityOff()
        # Lines lie in the picture's plane: they must win over it.
        mapper.SetResolveCoincidentTopologyToPolygonOffset()
        mapper.SetRelativeCoincidentTopologyLineOffsetParameters(0.0, -66000.0)
        actor = vtkActor()
        actor.SetMapper(mapper)
        actor.GetProperty().SetColor(*colour)
        actor.GetProperty().SetLineWidth(width)
        actor.GetProperty().LightingOff()
        actor.PickableOff()
        self.renderer.AddViewProp(actor)
        self._over.append(actor)

    def _write(self, text: str, where: tuple[float, float, float]) -> None:
        from vtkmodules.vtkRenderingCore import vtkBillboardTextActor3D

        actor = vtkBillboardTextActor3D()
        actor.SetInput(text)
        actor.SetPosition(*where)
        actor.SetDisplayOffset(10, 8)
        actor.ForceOpaqueOn()
        style = actor.GetTextProperty()
        style.SetFontSize(18)
        style.BoldOn()
        style.SetColor(*INK)
        style.SetShadow(True)
        self.renderer.AddViewProp(actor)
        self._over.append(actor)

    def _edge_letters(self) -> list[Any]:
        from vtkmodules.vtkRenderingCore import vtkTextActor

        edges = (
            (self.view.right, 0.98, 0.5, "Right", "Centered"),
            (self.view.left, 0.02, 0.5, "Left", "Centered"),
            (self.view.top, 0.5, 0.98, "Centered", "Top"),
            (self.view.bottom, 0.5, 0.02, "Centered", "Bottom"),
        )
        found = []
        for letter, x, y, across, upright in edges:
            actor = vtkTextActor()
            actor.SetInput(letter)
            actor.GetPositionCoordinate().SetCoordinateSystemToNormalizedViewport()
            actor.GetPositionCoordinate().SetValue(x, y)
            style = actor.GetTextProperty()
            getattr(style, f"SetJustificationTo{across}")()
            getattr(style, f"SetVerticalJustificationTo{upright}")()
            style.SetFontSize(20)
            style.BoldOn()
            style.SetColor(*INK)
            self.renderer.AddViewProp(actor)
            found.append(actor)
        return found

    def _crosshair(self) -> Any:
        from vtkmodules.vtkRenderingCore import vtkBillboardTextActor3D

        actor = vtkBillboardTextActor3D()
        actor.SetInput("+")
        actor.ForceOpaqueOn()
        style = actor.GetTextProperty()
        style.SetFontSize(22)
        style.SetColor(*CROSS)
        style.SetJustificationToCentered()
        style.SetVerticalJustificationToCentered()
        actor.VisibilityOff()
        self.renderer.AddViewProp(actor)
        return actor

    def render(self) -> None:
        """Draw soon."""
        self.interactor.update()

    # ------------------------------------------------------------ the mouse

    def _listen(self) -> None:
        from vtkmodules.vtkInteractionStyle import vtkInteractorStyleImage

        style: Any = vtkInteractorStyleImage()
        style.AutoAdjustCameraClippingRangeOff()
        self._pressed: tuple[int, ...] | None = None
        style.AddObserver("MouseWheelForwardEvent", lambda *_: self._scroll(1))
        style.AddObserver("MouseWheelBackwardEvent", lambda *_: self._scroll(-1))
        style.AddObserver("LeftButtonPressEvent", lambda *_: self._press(style))
        style.AddObserver("LeftButtonReleaseEvent", lambda *_: self._release(style))
        # Keys belong to the window's shortcuts, not to VTK's.
        style.AddObserver("CharEvent", lambda *_: None)
        style.AddObserver("InteractionEvent", lambda *_: self._regrey())
        self.interactor.SetInteractorStyle(style)
        self._style = style

    def _scroll(self, steps: int) -> None:
        self.slider.setValue(self.slider.value() + steps)

    def _press(self, style: Any) -> None:
        self._pressed = tuple(self.interactor.GetEventPosition())
        style.OnLeftButtonDown()

    def _release(self, style: Any) -> None:
        style.OnLeftButtonUp()
        here = tuple(self.interactor.GetEventPosition())
        if here == self._pressed and self.places:
            self._clicked(self.point_at(*here))
        self._pressed = None

    def point_at(self, x: int, y: int) -> tuple[float, float, float]:
        """The point of the slice, LPS mm, under a pixel counted from the lower left."""
        from vtkmodules.vtkRenderingCore import vtkCoordinate

        pixel = vtkCoordinate()
        pixel.SetCoordinateSystemToDisplay()
        pixel.SetValue(float(x), float(y), 0.0)
        found = pixel.GetComputedWorldValue(self.renderer)
        return at_place(self.view, (found[0], found[1], found[2]), self.place_mm())

    def close(self) -> None:
        """Free the window's OpenGL while it can still be reached."""
        self._style.RemoveAllObservers()
        self.clear()
        self.interactor.close()
