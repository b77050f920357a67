"""Takes the module's panel from a case to the export in a stand-in for Slicer; prints what it saw.

``python walk_through_slicer.py CASE EXPORT``
"""

import json
import os
import sys
import threading
from pathlib import Path

from desktop_slicer import Slicer, unwrap
from PySide6 import QtWidgets
from vtkmodules.vtkCommonMath import vtkMatrix4x4

slicer_app = Slicer()
main_thread = threading.get_ident()

import slicer  # noqa: E402
from hexafix.mrml import SceneLogic  # noqa: E402
from hexafix.mrml.nodes import ROLE, nodes_of  # noqa: E402
from hexafix.mrml.nodes import find as find_node  # noqa: E402
from hexafix.presenter import Step  # noqa: E402

import HexaFixModule  # noqa: E402 - only now there is a Slicer to import it in

seen = {}
parent = slicer_app.module_widget()


class Described:
    path = HexaFixModule.__file__


described = Described()
HexaFixModule.HexaFixModule(described)
seen["described"] = {
    "title": described.title,
    "hidden": described.hidden,
    "help": described.helpText,
    "icon": not described.icon.isNull(),
}

seen["logic_has_slicers_scene"] = HexaFixModule.HexaFixModuleLogic().scene is slicer.mrmlScene
seen["test_is_a_unittest"] = HexaFixModule.HexaFixModuleTest().id().split(".")[-1]

# A scene that was saved by HexaFix is open already.
held = json.loads(Path(sys.argv[1]).read_text())
SceneLogic(slicer.mrmlScene).save_case_into({**held, "case_id": "of-the-scene"})
widget = HexaFixModule.HexaFixModuleWidget(parent)
widget.setup()
widget.enter()
shell = widget.panel
presenter = shell.presenter
seen["scene_case"] = {key: presenter.snapshot.document.get(key) for key in ("case_id", "image")}
seen["scene_balls_diameter"] = presenter.snapshot.document["markers"]["ball_diameter_mm"]
presenter.undo()
presenter.set_case_id("of-the-panel")
SceneLogic(slicer.mrmlScene).save_case_into({**held, "case_id": "of-another-scene"})
slicer.mrmlScene.InvokeEvent(slicer.mrmlScene.EndImportEvent)
seen["own_case"] = presenter.snapshot.document["case_id"]
seen["opened"] = unwrap(parent).findChild(QtWidgets.QWidget, "stepStack") is not None


def find(name):
    return unwrap(parent).findChild(QtWidgets.QWidget, name)


def roles():
    return sorted(node.GetAttribute(ROLE) for node in nodes_of(slicer.mrmlScene))


threads, busy_ticks = set(), 0
presenter.changed.connect(lambda snapshot: threads.add(threading.get_ident()))

assert presenter.open_case(sys.argv[1]), presenter.snapshot.banners
seen["case_label"] = find("caseLabel").text()
seen["first_id"] = find("caseIdLineEdit").text()
find("caseIdLineEdit").setText("another-name")
find("caseIdLineEdit").editingFinished.emit()
seen["edited_id"] = presenter.snapshot.document["case_id"]
find("undoButton").click()
seen["undone_id"] = find("caseIdLineEdit").text()

find("runAllButton").click()
seen["busy_at_once"] = presenter.snapshot.busy
ticks = 0


def idle():
    global ticks
    ticks += 1
    return not presenter.snapshot.busy


slicer_app.events(idle)
seen["ticks"] = ticks
seen["threads"] = threads == {main_thread}
seen["banners"] = [banner.message for banner in presenter.snapshot.banners]
seen["states"] = {step.step.value: step.state.value for step in presenter.snapshot.steps}
seen["roles"] = roles()
seen["balls_rows"] = find("ballsTable").rowCount()
seen["balls"] = len(presenter.snapshot.tables["balls"].rows)
slicer_app.events(lambda: not shell._ui._timer.active)
seen["timer_stops"] = True

red = slicer.app.layoutManager().sliceWidget("Red")


def pixel_of_ball(index):
    """Where a ball stands in the axial view through it; no row of the table is chosen."""
    ras = shell.logic.ras_from_lps(shell.logic.select_ball(index))
    slicer.vtkMRMLSliceNode.JumpAllSlices(slicer.mrmlScene, *ras)
    inverse = vtkMatrix4x4()
    vtkMatrix4x4.Invert(red.mrmlSliceNode().GetXYToRAS(), inverse)
    find("ballsTable").clearSelection()
    return [round(value) for value in inverse.MultiplyPoint((*ras, 1.0))[:2]]


def chosen_row():
    return shell.panel.widgets.get("ballsTable", "index")


# A click on a ball in a slice view through it, and a drag that ends there.
x, y = pixel_of_ball(2)
red.sliceView().click(x - 40, y, drag=40)
seen["row_after_drag"] = chosen_row()
red.sliceView().click(x, y)
seen["row_after_click"] = chosen_row()
seen["clicked_place"] = [find(f"marker{axis}LineEdit").text() for axis in "LPS"]
seen["ball_place"] = list(shell.logic.select_ball(2))

# A view that comes with another layout is watched too, and none twice.
clicked = []
shell.panel.ball_chosen.connect(clicked.append)
slicer.app.layoutManager().show_another_slice("Slice4", red.mrmlSliceNode())
find("ballsTable").clearSelection()
slicer.app.layoutManager().sliceWidget("Slice4").sliceView().click(x, y)
red.sliceView().click(x, y)
seen["clicked_in_both"] = clicked
shell.panel.ball_chosen.disconnect(clicked.append)

# Choosing another ball brings all slices to it.
find("ballsTable").selectRow(4)
wanted = shell.logic.ras_from_lps(shell.logic.select_ball(4))
offsets = [
    slicer.app.layoutManager().sliceWidget(name).mrmlSliceNode().GetSliceOffset()
    for name in ("Yellow", "Green", "Red")
]
seen["slice_misses"] = [abs(abs(a) - abs(b)) for a, b in zip(offsets, wanted, strict=True)]

# The bone is dragged, let go, and the case holds the new motion.
shown_motion = shell.logic.fragment_motion_lps()
presenter.go_to(Step.CORRECTION)
find("dragBoneButton").click()
target = find_node(slicer.mrmlScene, "transform/target/fragment")
matrix = vtkMatrix4x4()
target.GetMatrixTransformToParent(matrix)
before = [matrix.GetElement(row, 3) for row in range(3)]
matrix.SetElement(0, 3, before[0] + 2.0)
target.SetMatrixTransformToParent(matrix)
seen["edited_while_dragging"] = presenter.snapshot.edited
slicer.app.layoutManager().threeDWidget(0).threeDView().click(10, 10, drag=30)
moved = presenter.snapshot.document["correction"]["matrix_lps"]
seen["moved_lps_mm"] = [moved[row][3] - shown_motion[row][3] for row in range(3)]
seen["fresh_after_drag"] = presenter.is_fresh(Step.SCHEDULE)
find("dragBoneButton").click()
presenter.undo()
seen["fresh_after_undo"] = presenter.is_fresh(Step.SCHEDULE)

# A row of the schedule moves the frame.
ring = find_node(slicer.mrmlScene, "transform/ring/proximal")


def pose(node):
    held = vtkMatrix4x4()
    node.GetMatrixTransformToParent(held)
    return [held.GetElement(r, c) for r in range(3) for c in range(4)]


start = pose(ring)
last = len(presenter.snapshot.tables["strut_plan"].rows) - 1
shell.panel.show_playback(last)
seen["ring_moves"] = max(abs(a - b) for a, b in zip(start, pose(ring), strict=True))

# Another module: clicks are not ours.
widget.exit()
x, y = pixel_of_ball(2)
red.sliceView().click(x, y)
seen["row_after_exit"] = chosen_row()
widget.enter()
red.sliceView().click(x, y)
seen["row_after_return"] = chosen_row()

# The scene is closed and the module entered again: the case is still there and shown.
slicer.mrmlScene.Clear(0)
seen["roles_after_close"] = roles()
widget.enter()
seen["roles_after_return"] = roles()

presenter.confirm_side(presenter.snapshot.document["limb"]["side"])
find("stepList").setCurrentRow(7)
seen["blocked"] = presenter.snapshot.export_blocked_by
picture = find("prescriptionPicture").pixmap()
seen["page_pixels"] = [picture.width(), picture.height()]
presenter.export(sys.argv[2])
slicer_app.events(lambda: not presenter.snapshot.busy)
seen["export_banners"] = [banner.message for banner in presenter.snapshot.banners]
seen["messages"] = slicer_app.messages
widget.cleanup()
seen["closed"] = presenter.closed
print(json.dumps(seen))
sys.stdout.flush()
# Qt and VTK are left as they are: Slicer, too, ends without taking a stand-in apart.
os._exit(0)
