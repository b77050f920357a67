"""Pictures of the scene without a screen: real displayable managers in an offscreen window."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hexafix.mrml.geometry import ras_points
from hexafix.mrml.nodes import slicer_core

MANAGERS_3D = (
    "Camera", "View", "Model", "Crosshair:3D", "OrientationMarker", "Markups", "LinearTransforms",
)  # fmt: skip

MANAGERS_2D = (
    *("VolumeGlyphSlice", "ModelSlice", "Crosshair", "OrientationMarker", "ScalarBar"),
    *("Markups", "Transforms:2D"),
)

BACKGROUND = (0.97, 0.97, 0.98)


class OffscreenView:
    """One view of a scene.

    Parameters
    ----------
    app : HeadlessMrmlApp
    name : str
        Unique in the scene; slice views of Slicer are Red, Yellow and Green.
    orientation : str or None
        ``Axial``, ``Sagittal`` or ``Coronal``; None: a 3D view.
    size : tuple of int
        Width and height in pixels.
    """

    def __init__(
        self,
        app: Any,
        name: str,
        orientation: str | None = None,
        size: tuple[int, int] = (500, 500),
    ) -> None:
        slicer = slicer_core()
        self.flat = orientation is not None
        self.size = size
        self._factory = _factory(slicer, app.app_logic, self.flat)
        self._open_window(size)
        self.group = slicer.vtkMRMLDisplayableManagerGroup()
        self.group.SetRenderer(self.renderer)
        self.group.Initialize(self._factory, self.renderer)
        self.logic = slicer.vtkMRMLSliceLogic() if self.flat else slicer.vtkMRMLViewLogic()
        self.logic.SetMRMLApplicationLogic(app.app_logic)
        self.logic.SetMRMLScene(app.scene)
        if self.flat:
            app.app_logic.GetSliceLogics().AddItem(self.logic)
            self.node = self.logic.AddSliceNode(name)
        else:
            app.app_logic.GetViewLogics().AddItem(self.logic)
            self.node = self.logic.AddViewNode(name)
        self.node.SetMappedInLayout(1)
        self.group.SetMRMLDisplayableNode(self.node)
        if self.flat:
            self.node.SetOrientation(orientation)
            self.logic.ResizeSliceNode(*size)
            self._show_image()
        else:
            self.node.SetBackgroundColor(*BACKGROUND)
            self.node.SetBackgroundColor2(*BACKGROUND)
            self.node.SetBoxVisible(False)
            self.node.SetAxisLabelsVisible(False)

    def _open_window(self, size: tuple[int, int]) -> None:
        from vtkmodules import vtkRenderingOpenGL2  # noqa: F401 - its factories
        from vtkmodules.vtkRenderingCore import (
            vtkRenderer,
            vtkRenderWindow,
            vtkRenderWindowInteractor,
        )

        self.renderer, self.window = vtkRenderer(), vtkRenderWindow()
        self.window.SetOffScreenRendering(1)
        self.window.SetMultiSamples(0)
        self.window.SetSize(*size)
        self.window.AddRenderer(self.renderer)
        self.interactor = vtkRenderWindowInteractor()
        self.interactor.SetRenderWindow(self.window)
        self.interactor.Initialize()

    def _show_image(self) -> None:
        """The slice's pixels behind everything else."""
        from vtkmodules.vtkRenderingCore import vtkActor2D, vtkImageMapper

        self._mapper = vtkImageMapper()
        self._mapper.SetColorWindow(255)
        self._mapper.SetColorLevel(127.5)
        actor = vtkActor2D()
        actor.SetMapper(self._mapper)
        actor.GetProperty().SetDisplayLocationToBackground()
        self.renderer.AddViewProp(actor)

    def show_slice(self, volume_node: Any, center_lps_mm: ArrayLike) -> None:
        """Show the slice of a volume through a point, LPS mm (slice views only)."""
        self.logic.GetSliceCompositeNode().SetBackgroundVolumeID(volume_node.GetID())
        self.logic.FitSliceToBackground()
        x, y, z = (float(v) for v in ras_points(center_lps_mm))
        self.node.JumpSliceByCentering(x, y, z)
        self._mapper.SetInputConnection(self.logic.GetImageDataConnection())

    def aim(
        self,
        center_lps_mm: ArrayLike,
        *,
        toward: ArrayLike,
        up: ArrayLike,
        height_mm: float,
    ) -> None:
        """Look from direction `toward` at a point, in parallel projection (3D views only).

        Parameters
        ----------
        center_lps_mm : array_like, shape (3,)
            In the middle of the picture, LPS mm.
        toward, up : array_like, shape (3,)
            Directions in LPS: from the middle towards the viewer, and up in the picture.
        height_mm : float
            Height of the picture in the patient.
        """
        camera = self.renderer.GetActiveCamera()
        camera.ParallelProjectionOn()
        away = np.asarray(center_lps_mm, float) + 1000.0 * np.asarray(toward, float)
        camera.SetFocalPoint(*(float(v) for v in ras_points(center_lps_mm)))
        camera.SetPosition(*(float(v) for v in ras_points(away)))
        camera.SetViewUp(*(float(v) for v in ras_points(up)))
        camera.SetParallelScale(height_mm / 2)
        self.renderer.ResetCameraClippingRange()

    def pixel_of(self, point_lps_mm: ArrayLike) -> tuple[int, int]:
        """Column and row of `image` at which a point, LPS mm, is seen."""
        x, y, z = (float(v) for v in ras_points(point_lps_mm))
        if self.flat:
            matrix = self.node.GetXYToRAS()
            inverse = type(matrix)()
            inverse.DeepCopy(matrix)
            inverse.Invert()
            column, row, _, _ = inverse.MultiplyPoint((x, y, z, 1.0))
        else:
            self.renderer.SetWorldPoint(x, y, z, 1.0)
            self.renderer.WorldToDisplay()
            column, row, _ = self.renderer.GetDisplayPoint()
        return round(column), self.size[1] - 1 - round(row)

    def image(self) -> NDArray[np.uint8]:
        """The picture, shape (height, width, 3), first row on top."""
        from vtkmodules.util.numpy_support import vtk_to_numpy
        from vtkmodules.vtkRenderingCore import vtkWindowToImageFilter

        if not self.flat:
            self.renderer.ResetCameraClippingRange()
        self.window.Render()
        grab = vtkWindowToImageFilter()
        grab.SetInput(self.window)
        grab.SetInputBufferTypeToRGB()
        grab.ReadFrontBufferOff()
        grab.ShouldRerenderOff()
        grab.Update()
        shot = grab.GetOutput()
        width, height, _ = shot.GetDimensions()
        pixels = vtk_to_numpy(shot.GetPointData().GetScalars())
        return np.array(pixels.reshape(height, width, 3)[::-1], np.uint8)

    def close(self) -> None:
        """Let go of the window; to be called before the interpreter ends."""
        self.group.SetMRMLDisplayableNode(None)
        self.window.Finalize()


def _factory(slicer: Any, app_logic: Any, flat: bool) -> Any:
    """The singleton that makes displayable managers, taught those that are needed."""
    kind = "Slice" if flat else "ThreeD"
    factory = getattr(slicer, f"vtkMRML{kind}ViewDisplayableManagerFactory").GetInstance()
    factory.SetMRMLApplicationLogic(app_logic)
    for name in MANAGERS_2D if flat else MANAGERS_3D:
        first, _, dimension = name.partition(":")
        whole = f"vtkMRML{first}DisplayableManager{dimension}"
        if not factory.IsDisplayableManagerRegistered(whole):
            factory.RegisterDisplayableManager(whole)
    return factory
