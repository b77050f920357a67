# ruff: noqa: N802, N815 - Qt's and Slicer's names
"""Stands in for desktop Slicer in a process of its own; written from its public source.

``qt`` has PythonQt's manners over PySide6: properties are attributes and no methods, signals are
connected by their whole name, and a QByteArray made of bytes ends at their first zero. ``slicer``
is slicer-core with what the application adds to it: base classes, ``util``, ``app``, ``mrmlScene``.
"""

import os
import sys
import types

os.environ["QT_QPA_PLATFORM"] = "offscreen"
os.environ["VTK_DEFAULT_OPENGL_WINDOW"] = "vtkOSOpenGLRenderWindow"

from PySide6 import QtCore, QtGui, QtUiTools, QtWidgets
from vtkmodules.vtkRenderingCore import vtkRenderWindowInteractor

ROOMS = (QtWidgets, QtGui, QtCore)


class Wrapped:
    """A QObject as PythonQt shows it."""

    def __init__(self, held):
        object.__setattr__(self, "_held", held)

    def __getattr__(self, name):
        held = self._held
        if held.metaObject().indexOfProperty(name) >= 0:
            return wrap(held.property(name))
        value = getattr(held, name)
        if isinstance(value, QtCore.SignalInstance) or not callable(value):
            return value
        return lambda *given: wrap(value(*map(unwrap, given)))

    def __setattr__(self, name, value):
        if not self._held.setProperty(name, unwrap(value)):
            raise AttributeError(name)

    def connect(self, signal, slot):
        if self._held.metaObject().indexOfSignal(signal) < 0:
            raise ValueError(f"{self._held.metaObject().className()} has no signal {signal}")
        assert QtCore.QObject.connect(self._held, QtCore.SIGNAL(signal), slot)

    def __eq__(self, other):
        return unwrap(self) is unwrap(other)

    def __hash__(self):
        return hash(self._held)


def wrap(value):
    return Wrapped(value) if isinstance(value, QtCore.QObject) else value


def unwrap(value):
    return value._held if isinstance(value, Wrapped) else value


class Kind:
    """A QObject's class in PythonQt."""

    def __init__(self, kind):
        self._kind = kind

    def __call__(self, *given):
        return Wrapped(self._kind(*map(unwrap, given)))

    def __getattr__(self, name):
        value = getattr(self._kind, name)
        if callable(value) and not isinstance(value, type):
            return lambda *given: wrap(value(*map(unwrap, given)))
        return value


class PythonQt(types.ModuleType):
    def __getattr__(self, name):
        if name.startswith("__"):
            raise AttributeError(name)
        kind = next((getattr(room, name) for room in ROOMS if hasattr(room, name)), None)
        if kind is None:
            raise AttributeError(name)
        return Kind(kind) if issubclass(kind, QtCore.QObject) else kind

    @staticmethod
    def QByteArray(content):
        return content.partition(b"\0")[0]


class View:
    """A slice or 3D view: its interactor without a window."""

    def __init__(self):
        self._interactor = vtkRenderWindowInteractor()

    def interactor(self):
        return self._interactor

    def click(self, x, y, *, drag=0):
        self._interactor.SetEventInformation(x, y, 0, 0)
        self._interactor.InvokeEvent("LeftButtonPressEvent")
        self._interactor.SetEventInformation(x + drag, y, 0, 0)
        self._interactor.InvokeEvent("LeftButtonReleaseEvent")


class SliceWidget:
    def __init__(self, node):
        self._node, self._view = node, View()

    def sliceView(self):
        return self._view

    def mrmlSliceNode(self):
        return self._node


class ThreeDWidget:
    def __init__(self):
        self._view = View()

    def threeDView(self):
        return self._view


class LayoutManager:
    threeDViewCount = 1

    def __init__(self, slices):
        self._slices, self._threed = slices, ThreeDWidget()
        self._slots = []

    def connect(self, signal, slot):
        assert signal == "layoutChanged(int)"
        self._slots.append(slot)

    def disconnect(self, signal, slot):
        assert signal == "layoutChanged(int)"
        self._slots.remove(slot)

    def show_another_slice(self, name, node):
        """The user chooses a layout with one more view."""
        self._slices[name] = SliceWidget(node)
        for slot in tuple(self._slots):
            slot(3)

    def sliceViewNames(self):
        return tuple(self._slices)

    def sliceWidget(self, name):
        return self._slices[name]

    def threeDWidget(self, index):
        assert index == 0
        return self._threed


class Application:
    def __init__(self, world, layout):
        self._world, self._layout = world, layout

    def applicationLogic(self):
        return self._world.app_logic

    def layoutManager(self):
        return self._layout


def base_classes():
    """Slicer's base classes as far as a module sees them."""
    import unittest

    module = types.ModuleType("slicer.ScriptedLoadableModule")

    class ScriptedLoadableModule:
        def __init__(self, parent):
            self.parent = parent
            self.moduleName = type(self).__name__
            parent.title = ""
            parent.categories = []
            parent.hidden = False

    class ScriptedLoadableModuleWidget:
        def __init__(self, parent=None):
            self.moduleName = type(self).__name__.removesuffix("Widget")
            self.parent = parent
            self.layout = parent.layout()

        def setup(self):
            pass

        def cleanup(self):
            pass

    class ScriptedLoadableModuleLogic:
        def __init__(self, parent=None):
            super().__init__()
            self.moduleName = type(self).__name__.removesuffix("Logic")

    class ScriptedLoadableModuleTest(unittest.TestCase):
        def runTest(self):
            raise NotImplementedError

    for kind in (ScriptedLoadableModule, ScriptedLoadableModuleWidget):
        setattr(module, kind.__name__, kind)
    for kind in (ScriptedLoadableModuleLogic, ScriptedLoadableModuleTest):
        setattr(module, kind.__name__, kind)
    return module


class Slicer:
    """The running application.

    Attributes
    ----------
    messages : list of str
        What `slicer.util.errorDisplay` showed.
    """

    def __init__(self):
        from hexafix.mrml import HeadlessMrmlApp

        self.application = QtWidgets.QApplication(sys.argv[:1])
        self.messages = []
        sys.modules["qt"] = PythonQt("qt")
        self.world = HeadlessMrmlApp()
        import slicer

        slicer.ScriptedLoadableModule = base_classes()
        sys.modules["slicer.ScriptedLoadableModule"] = slicer.ScriptedLoadableModule
        slicer.mrmlScene = self.world.scene
        slices = {}
        for name, orientation in (("Red", "Axial"), ("Yellow", "Sagittal"), ("Green", "Coronal")):
            node = self.world.scene.AddNewNodeByClass("vtkMRMLSliceNode", name)
            node.SetLayoutName(name)
            node.SetOrientation(orientation)
            node.SetDimensions(400, 300, 1)
            node.SetFieldOfView(400, 300, 1)
            slices[name] = SliceWidget(node)
        slicer.app = Application(self.world, LayoutManager(slices))
        util = types.ModuleType("slicer.util")
        util.loadUI = self._load_ui
        util.childWidgetVariables = self._children
        util.errorDisplay = lambda text, windowTitle=None: self.messages.append(text)
        slicer.util = sys.modules["slicer.util"] = util

    @staticmethod
    def _load_ui(path):
        widget = QtUiTools.QUiLoader().load(path)
        assert widget is not None, path
        return Wrapped(widget)

    @staticmethod
    def _children(root):
        named = types.SimpleNamespace()
        for child in unwrap(root).findChildren(QtCore.QObject):
            if child.objectName():
                setattr(named, child.objectName(), Wrapped(child))
        return named

    @staticmethod
    def module_widget():
        """A widget with a layout, as Slicer gives it to a module."""
        widget = QtWidgets.QWidget()
        widget.setLayout(QtWidgets.QVBoxLayout())
        return Wrapped(widget)

    def events(self, until, *, seconds=120.0):
        """Let the event loop run until something holds."""
        import time

        end = time.monotonic() + seconds
        while not until():
            assert time.monotonic() < end, "this took too long"
            self.application.processEvents()
