"""Renders a scene with VTK in a process of its own, because a broken OpenGL ends the process.

Run as a script it reads the name of a folder from standard input, takes ``scene.npz`` there and
writes one PNG a view beside it. It imports nothing of HexaFix, so that it starts at once; the
shapes it draws are shared with the workstation by `hexafix.surfaces`, which renders nothing here.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Mapping
from importlib import import_module
from pathlib import Path
from types import SimpleNamespace
from typing import Any

BONE_HU, METAL_HU = 220.0, 2300.0
"""Iso-values of bone and of pins and wires in the coarse copy of the CT."""

EXIT_NO_VTK, EXIT_NO_WINDOW, EXIT_BLANK = 3, 4, 5

STEEL, IVORY, BALL = (0.62, 0.66, 0.70), (0.96, 0.91, 0.78), (0.90, 0.92, 0.95)


SHAPE_CLASSES = {
    "vtkCommonCore": ("vtkPoints",),
    "vtkCommonDataModel": ("vtkCellArray", "vtkImageData", "vtkPolyData"),
    "vtkCommonTransforms": ("vtkTransform",),
    "vtkFiltersCore": (
        *("vtkFlyingEdges3D", "vtkPolyDataConnectivityFilter", "vtkPolyDataNormals"),
        *("vtkReverseSense", "vtkTubeFilter", "vtkWindowedSincPolyDataFilter"),
    ),
    "vtkFiltersGeneral": ("vtkTransformPolyDataFilter",),
    "vtkFiltersSources": ("vtkLineSource", "vtkSphereSource"),
    "vtkImagingGeneral": ("vtkImageGaussianSmooth",),
    "util.numpy_support": ("numpy_to_vtk", "vtk_to_numpy"),
}
"""What the shapes need of VTK: nothing that touches OpenGL."""

PICTURE_CLASSES = {
    "vtkIOImage": ("vtkPNGWriter",),
    "vtkRenderingCore": (
        *("vtkActor", "vtkLight", "vtkPolyDataMapper", "vtkRenderer", "vtkRenderWindow"),
        "vtkWindowToImageFilter",
    ),
    # The factories of OpenGL must be loaded, though nothing names them.
    "vtkRenderingOpenGL2": (),
}
"""What the pictures need besides; together a quarter of the time of the whole of VTK."""


def import_vtk(classes: Mapping[str, tuple[str, ...]]) -> Any:
    """The named classes of VTK's modules as attributes of one namespace."""
    found = SimpleNamespace()
    for module, names in classes.items():
        loaded = import_module(f"vtkmodules.{module}")
        for name in names:
            setattr(found, name, getattr(loaded, name))
    return found


def _actor(v: Any, source: Any, color: Any, **look: float) -> Any:
    mapper = v.vtkPolyDataMapper()
    if hasattr(source, "GetOutputPort"):
        mapper.SetInputConnection(source.GetOutputPort())
    else:
        mapper.SetInputData(source)
    mapper.ScalarVisibilityOff()
    actor = v.vtkActor()
    actor.SetMapper(mapper)
    material = actor.GetProperty()
    material.SetColor(*(float(c) for c in color))
    material.SetAmbient(0.18)
    material.SetDiffuse(0.82)
    material.SetSpecular(look.get("specular", 0.15))
    material.SetSpecularPower(look.get("power", 20.0))
    material.SetOpacity(look.get("opacity", 1.0))
    return actor


def sphere(v: Any, center: Any, radius: float, *, resolution: int = 40) -> Any:
    """Source of a ball about an LPS point, mm."""
    source = v.vtkSphereSource()
    source.SetCenter(*(float(x) for x in center))
    source.SetRadius(float(radius))
    source.SetThetaResolution(resolution)
    source.SetPhiResolution(resolution)
    return source


def tube(v: Any, start: Any, end: Any, radius: float) -> Any:
    """Filter that makes a closed round rod between two LPS points, mm."""
    line = v.vtkLineSource()
    line.SetPoint1(*(float(x) for x in start))
    line.SetPoint2(*(float(x) for x in end))
    tube = v.vtkTubeFilter()
    tube.SetInputConnection(line.GetOutputPort())
    tube.SetRadius(radius)
    tube.SetNumberOfSides(32)
    tube.CappingOn()
    return tube


def plate(v: Any, outlines: Any) -> Any:
    """A ring plate from its outlines, shape (4, N, 3): top outer, inner, then low inner, outer."""
    import numpy as np

    count = outlines.shape[1]
    points = v.vtkPoints()
    points.SetData(v.numpy_to_vtk(outlines.reshape(-1, 3).astype(float), deep=True))
    this = np.arange(count)
    after = (this + 1) % count
    quads = [
        np.stack([a * count + this, a * count + after, b * count + after, b * count + this], -1)
        for a, b in ((0, 1), (1, 2), (2, 3), (3, 0))
    ]
    cells = v.vtkCellArray()
    for quad in np.vstack(quads):
        cells.InsertNextCell(4, [int(x) for x in quad])
    shape = v.vtkPolyData()
    shape.SetPoints(points)
    shape.SetPolys(cells)
    normals = v.vtkPolyDataNormals()
    normals.SetInputData(shape)
    normals.SetFeatureAngle(40.0)
    return normals


def blurred(v: Any, hu: Any) -> Any:
    """Filter that smooths the noise of a coarse CT, HU of shape (K, J, I), in voxel space."""
    k, j, i = hu.shape
    image = v.vtkImageData()
    image.SetDimensions(i, j, k)
    image.GetPointData().SetScalars(v.numpy_to_vtk(hu.ravel(), deep=True))
    smooth = v.vtkImageGaussianSmooth()
    smooth.SetInputData(image)
    smooth.SetStandardDeviations(0.7, 0.7, 0.7)
    return smooth


def surface(v: Any, image: Any, affine: Any, level: float) -> Any | None:
    """The iso-surface of the coarse CT in LPS without specks, or None if there is none.

    Its normals and the order of its corners point out of what is denser than `level` HU, whatever
    the hand of the voxel grid.
    """
    import numpy as np

    contour = v.vtkFlyingEdges3D()
    contour.SetInputConnection(image.GetOutputPort())
    contour.SetValue(0, level)
    contour.ComputeNormalsOff()
    contour.ComputeScalarsOff()
    parts = v.vtkPolyDataConnectivityFilter()
    parts.SetInputConnection(contour.GetOutputPort())
    parts.SetExtractionModeToAllRegions()
    parts.Update()
    sizes = parts.GetRegionSizes()
    count = [sizes.GetValue(k) for k in range(parts.GetNumberOfExtractedRegions())]
    if not count:
        return None
    parts.SetExtractionModeToSpecifiedRegions()
    parts.InitializeSpecifiedRegionList()
    for region, size in enumerate(count):
        if size >= max(150, 0.03 * max(count)):
            parts.AddSpecifiedRegion(region)
    smooth = v.vtkWindowedSincPolyDataFilter()
    smooth.SetInputConnection(parts.GetOutputPort())
    smooth.SetNumberOfIterations(12)
    smooth.SetPassBand(0.08)
    smooth.NormalizeCoordinatesOn()
    place = v.vtkTransform()
    place.SetMatrix([float(x) for x in affine.ravel()])
    moved = v.vtkTransformPolyDataFilter()
    moved.SetTransform(place)
    moved.SetInputConnection(smooth.GetOutputPort())
    outward = moved
    if np.linalg.det(affine[:3, :3]) < 0:
        # A mirrored voxel grid turns the triangles inside out.
        outward = v.vtkReverseSense()
        outward.SetInputConnection(moved.GetOutputPort())
        outward.ReverseCellsOn()
        outward.ReverseNormalsOff()
    normals = v.vtkPolyDataNormals()
    normals.SetInputConnection(outward.GetOutputPort())
    normals.SplittingOff()
    normals.ConsistencyOff()
    normals.Update()
    return normals if normals.GetOutput().GetNumberOfCells() else None


def _bone_actors(v: Any, hu: Any, affine: Any) -> list[Any]:
    image = blurred(v, hu)
    bone = surface(v, image, affine, BONE_HU)
    metal = surface(v, image, affine, METAL_HU)
    actors = []
    if bone is not None:
        actor = _actor(v, bone, IVORY, opacity=0.7, specular=0.05)
        # Only the near side of the bone is drawn: translucent without sorting by depth.
        actor.GetProperty().BackfaceCullingOn()
        actors.append(actor)
    if metal is not None:
        actors.append(_actor(v, metal, STEEL, specular=0.5))
    return actors


def _actors(v: Any, scene: Any) -> list[Any]:
    actors = []
    for outlines, color in zip(scene["plates"], scene["plate_colors"], strict=True):
        actors.append(_actor(v, plate(v, outlines), color, specular=0.25))
    for (a, b), color in zip(scene["struts"], scene["strut_colors"], strict=True):
        middle = a + 0.62 * (b - a)
        actors.append(_actor(v, tube(v, b, middle, 5.5), color, specular=0.3))
        actors.append(_actor(v, tube(v, a, b, 3.4), color, specular=0.3))
        actors.extend(_actor(v, sphere(v, end, 6.0), STEEL, specular=0.5) for end in (a, b))
    for center, diameter in zip(scene["balls"], scene["ball_diameters"], strict=True):
        actors.append(_actor(v, sphere(v, center, diameter / 2), BALL, specular=0.9, power=40.0))
    if scene["bone"].size:
        actors.extend(_bone_actors(v, scene["bone"], scene["bone_affine"]))
    return actors


def _light(renderer: Any, v: Any) -> None:
    """Two lights that follow the camera: one at the viewer, one above it."""
    renderer.AutomaticLightCreationOff()
    for place, strength in (((0.15, 0.2, 1.0), 0.72), ((-0.5, 1.2, 0.45), 0.5)):
        light = v.vtkLight()
        light.SetLightTypeToCameraLight()
        light.SetPosition(*place)
        light.SetFocalPoint(0.0, 0.0, 0.0)
        light.SetIntensity(strength)
        renderer.AddLight(light)


def _aim(renderer: Any, center: Any, toward: Any, up: Any, height_mm: float) -> None:
    camera = renderer.GetActiveCamera()
    camera.ParallelProjectionOn()
    camera.SetFocalPoint(*(float(x) for x in center))
    camera.SetPosition(*(float(x) for x in center + 1000.0 * toward))
    camera.SetViewUp(*(float(x) for x in up))
    camera.SetParallelScale(float(height_mm) / 2)
    camera.SetClippingRange(1.0, 2500.0)


def _window(v: Any) -> tuple[Any, Any] | None:
    """An offscreen window and its lit renderer, warmed up; None if it is not the one asked for.

    The first picture makes the driver compile its programs. That happens here, while the parent
    still reads the CT.
    """
    window = v.vtkRenderWindow()
    wanted = os.environ.get("VTK_DEFAULT_OPENGL_WINDOW")
    if wanted and window.GetClassName() != wanted:
        return None
    window.SetOffScreenRendering(1)
    window.SetMultiSamples(0)
    window.SetAlphaBitPlanes(1)
    renderer = v.vtkRenderer()
    renderer.SetBackground(1.0, 1.0, 1.0)
    renderer.UseFXAAOn()
    _light(renderer, v)
    window.AddRenderer(renderer)
    warm = [_actor(v, sphere(v, (9.0 * n, 0.0, 0.0), 4.0), BALL, opacity=o)
            for n, o in enumerate((1.0, 0.7))]  # fmt: skip
    for actor in warm:
        renderer.AddActor(actor)
    window.SetSize(64, 64)
    window.Render()
    for actor in warm:
        renderer.RemoveActor(actor)
    return window, renderer


def render(folder: Path, v: Any, window: Any, renderer: Any) -> int:
    """Write ``view-<n>.png`` for each view of the scene in `folder`; returns the exit code."""
    import numpy as np

    with np.load(folder / "scene.npz", allow_pickle=False) as stored:
        scene = dict(stored)
    for actor in _actors(v, scene):
        renderer.AddActor(actor)
    for number, (axes, size, pixels) in enumerate(
        zip(scene["view_axes"], scene["view_sizes"], scene["view_pixels"], strict=True)
    ):
        window.SetSize(int(pixels[0]), int(pixels[1]))
        _aim(renderer, axes[3], axes[2], axes[1], size[1])
        window.Render()
        shot = v.vtkWindowToImageFilter()
        shot.SetInput(window)
        shot.SetInputBufferTypeToRGB()
        shot.ReadFrontBufferOff()
        shot.ShouldRerenderOff()
        shot.Update()
        values = v.vtk_to_numpy(shot.GetOutput().GetPointData().GetScalars())
        if values.min() == values.max():
            return EXIT_BLANK
        writer = v.vtkPNGWriter()
        writer.SetCompressionLevel(1)
        writer.SetInputData(shot.GetOutput())
        writer.SetFileName(str(folder / f"view-{number}.png"))
        writer.Write()
    return 0


def main() -> int:
    """Import VTK, wait for the folder's name, render."""
    try:
        v = import_vtk(SHAPE_CLASSES | PICTURE_CLASSES)
    except ImportError:
        return EXIT_NO_VTK
    made = _window(v)
    if made is None:
        return EXIT_NO_WINDOW
    line = sys.stdin.readline().strip()
    return render(Path(line), v, *made) if line else 0


if __name__ == "__main__":
    code = main()
    sys.stdout.flush()
    # Some OpenGL drivers crash while they are taken down; the pictures are already written.
    os._exit(code)
