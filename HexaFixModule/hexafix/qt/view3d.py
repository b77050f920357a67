"""The 3D view: rings, struts, numbered balls, bone fragments, target, and the dragging of bone."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from hexafix.qt.kit import kit, views
from hexafix.qt.shown import Outline

SKY, FLOOR = "#dfe6ec", "#9fb0bf"
CLOSER = 1.25
"""How much nearer than a box about everything."""

INK = (0.08, 0.1, 0.14)

Matrix = Sequence[Sequence[float]]


class View3D:
    """The frame on the limb, in LPS mm.

    Parameters
    ----------
    ball_clicked : callable
        Called with a ball's name as shown, e.g. ``ball-3``.
    dragged : callable
        Called with the 4×4 motion, LPS mm, when the user lets the bone go.
    """

    def __init__(
        self,
        *,
        ball_clicked: Callable[[str], None],
        dragged: Callable[[list[list[float]]], None],
    ) -> None:
        q = kit()
        self._ball_clicked, self._dragged = ball_clicked, dragged
        self.frame = q.QWidget()
        self.frame.setObjectName("threeDView")
        # Drawn when something changes, by no timer.
        self.plotter = views().QtInteractor(
            parent=self.frame, auto_update=False, multi_samples=0, off_screen=False
        )
        self.plotter.interactor.setAccessibleName("3D view of the frame")
        self.title = q.QLabel("<b>Frame</b>")
        down = q.QVBoxLayout(self.frame)
        down.setContentsMargins(2, 2, 2, 2)
        down.setSpacing(1)
        down.addLayout(self._head(q))
        down.addWidget(self.plotter.interactor, 1)
        self.plotter.set_background(FLOOR, top=SKY)
        self.plotter.renderer.GetActiveCamera().ParallelProjectionOn()
        self.plotter.add_axes(xlabel="L", ylabel="P", zlabel="H", interactive=False)
        self._actors: dict[str, Any] = {}
        self._meshes: dict[str, Outline] = {}
        self._labels: list[Any] = []
        self._label_texts: tuple[Any, ...] = ()
        self._widget: Any = None
        self._held: Any = None
        self._fitted = False
        self._pressed: tuple[int, ...] | None = None
        self._listen()
        self.look((0, -1, 0), (0, 0, 1))

    def _head(self, q: Any) -> Any:
        across = q.QHBoxLayout()
        across.addWidget(self.title, 1)
        for text, tip, vector, up in (
            ("Front", "From the patient's front", (0, -1, 0), (0, 0, 1)),
            ("Left", "From the patient's left", (1, 0, 0), (0, 0, 1)),
            ("Right", "From the patient's right", (-1, 0, 0), (0, 0, 1)),
            ("Top", "From the head", (0, 0, 1), (0, -1, 0)),
        ):
            button = q.QToolButton()
            button.setText(text)
            button.setToolTip(tip)
            button.setAccessibleName(tip)
            button.clicked.connect(lambda *_, vector=vector, up=up: self.look(vector, up))
            across.addWidget(button)
        return across

    def look(self, vector: tuple[int, int, int], up: tuple[int, int, int]) -> None:
        """Look at everything from a direction in LPS."""
        self.plotter.view_vector(vector, viewup=up, render=False)
        self.plotter.reset_camera(render=False)
        self.plotter.camera.zoom(CLOSER)
        self.render()

    # ------------------------------------------------------------ content

    def show(self, meshes: Mapping[str, Outline]) -> None:
        """Show exactly these meshes by name, changing only those that are others."""
        for name in [name for name in self._meshes if name not in meshes]:
            self._remove(name)
        for name, outline in meshes.items():
            if self._meshes.get(name) is outline:
                continue
            self._remove(name)
            self._meshes[name] = outline
            self._actors[name] = self._add(name, outline)
        if meshes and not self._fitted:
            self._fitted = True
            self.look((0, -1, 0), (0, 0, 1))
        if not meshes:
            self._fitted = False

    @property
    def names(self) -> frozenset[str]:
        """Names of what is shown."""
        return frozenset(self._actors)

    def refit(self) -> None:
        """Fit the view to what will be shown next."""
        self._fitted = False

    def _add(self, name: str, outline: Outline) -> Any:
        return self.plotter.add_mesh(
            views().pyvista.wrap(outline.mesh),
            name=name,
            color=outline.colour,
            opacity=outline.opacity,
            smooth_shading=True,
            specular=0.2,
            reset_camera=False,
            render=False,
            pickable=name.startswith("ball-"),
            copy_mesh=False,
        )

    def _remove(self, name: str) -> None:
        actor = self._actors.pop(name, None)
        self._meshes.pop(name, None)
        if actor is not None:
            self.plotter.remove_actor(actor, reset_camera=False, render=False)

    def move(self, name: str, matrix_lps: Matrix | None) -> None:
        """Show a mesh moved by a 4×4 matrix, LPS mm; None shows it where the CT does."""
        actor = self._actors.get(name)
        if actor is not None:
            rows = matrix_lps or ((1, 0, 0, 0), (0, 1, 0, 0), (0, 0, 1, 0), (0, 0, 0, 1))
            actor.user_matrix = [list(row) for row in rows]

    def write(self, labels: Sequence[tuple[str, tuple[float, float, float]]]) -> None:
        """Write texts at points, LPS mm, before everything else."""
        from vtkmodules.vtkRenderingCore import vtkBillboardTextActor3D

        if tuple(labels) == self._label_texts:
            return
        self._label_texts = tuple(labels)
        for actor in self._labels:
            self.plotter.renderer.RemoveViewProp(actor)
        self._labels = []
        for text, where in labels:
            actor = vtkBillboardTextActor3D()
            actor.SetInput(text)
            actor.SetPosition(*where)
            actor.SetDisplayOffset(12, 10)
            actor.ForceOpaqueOn()
            actor.PickableOff()
            style = actor.GetTextProperty()
            style.SetFontSize(15 if text.startswith("S") else 20)
            style.BoldOn()
            style.SetColor(*INK)
            style.SetBackgroundColor(1.0, 1.0, 1.0)
            style.SetBackgroundOpacity(0.75)
            self.plotter.renderer.AddViewProp(actor)
            self._labels.append(actor)

    def render(self) -> None:
        """Draw soon."""
        kit().QWidget.update(self.plotter)

    # ------------------------------------------------------------ dragging

    def drag(self, name: str | None) -> None:
        """Put handles on a mesh that turn and move it; None takes them away."""
        actor = self._actors.get(name or "")
        if actor is self._held:
            return
        if self._widget is not None:
            self._widget.remove()
            self._widget = None
        self._held = actor
        if actor is not None:
            self._widget = self.plotter.add_affine_transform_widget(
                actor,
                scale=0.35,
                release_callback=lambda matrix: self._dragged(
                    [[float(value) for value in row] for row in matrix]
                ),
            )

    @property
    def handles(self) -> Any:
        """The handles while the bone can be dragged."""
        return self._widget

    # ------------------------------------------------------------ the mouse

    def _listen(self) -> None:
        interactor = self.plotter.iren
        interactor.add_observer("LeftButtonPressEvent", self._press)
        interactor.add_observer("EndInteractionEvent", self._release)
        interactor.add_observer("LeftButtonReleaseEvent", self._release)
        self.plotter.enable_trackball_style()

    def _press(self, *_: Any) -> None:
        self._pressed = tuple(self.plotter.iren.get_event_position())

    def _release(self, *_: Any) -> None:
        here = tuple(self.plotter.iren.get_event_position())
        pressed, self._pressed = self._pressed, None
        if self._widget is None and pressed == here:
            name = self.ball_at(*here)
            if name is not None:
                self._ball_clicked(name)

    def ball_at(self, x: int, y: int) -> str | None:
        """The name of the ball under a pixel counted from the lower left."""
        from vtkmodules.vtkRenderingCore import vtkPropPicker

        picker = vtkPropPicker()
        picker.PickFromListOn()
        balls = {name: actor for name, actor in self._actors.items() if name.startswith("ball-")}
        for actor in balls.values():
            picker.AddPickList(actor)
        picker.Pick(float(x), float(y), 0.0, self.plotter.renderer)
        hit = picker.GetActor()
        return next((name for name, actor in balls.items() if actor is hit), None)

    def close(self) -> None:
        """Free the window's OpenGL while it can still be reached."""
        self.drag(None)
        self.plotter.close()
