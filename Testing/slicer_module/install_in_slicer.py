"""Opens the module where packages are missing, declines, then consents; prints what it saw."""

import json
import os
import sys
import types

from desktop_slicer import Slicer, unwrap
from PySide6 import QtWidgets

slicer_app = Slicer()
installed = set()
asked = []

packaging = types.ModuleType("slicer.packaging")
packaging.pip_check = lambda need: need.startswith(("numpy", "scipy")) or need in installed


def pip_ensure(requirements, requester=None):
    asked.append([list(requirements), requester])
    if len(asked) == 1:
        raise RuntimeError("User declined package installation")
    installed.update(requirements)


packaging.pip_ensure = pip_ensure
import slicer  # noqa: E402 - only now there is a Slicer to import it in

slicer.packaging = sys.modules["slicer.packaging"] = packaging

heavy = ("pydantic", "typst", "pydicom", "SimpleITK")
before = {name for name in heavy if name in sys.modules}
for name in [name for name in sys.modules if name.split(".")[0] in heavy]:
    del sys.modules[name]
import HexaFixModule  # noqa: E402

parent = slicer_app.module_widget()
widget = HexaFixModule.HexaFixModuleWidget(parent)
widget.setup()
widget.enter()
widget.exit()


def opened():
    return unwrap(parent).findChild(QtWidgets.QWidget, "stepStack") is not None


buttons = unwrap(parent).findChildren(QtWidgets.QPushButton)
seen = {
    "asked_before": list(asked),
    "opened_before": opened(),
    "loaded_before": [name for name in heavy if name in sys.modules],
    "labels": [label.text() for label in unwrap(parent).findChildren(QtWidgets.QLabel)],
    "buttons": [button.text() for button in buttons],
}
buttons[0].click()
seen |= {"declined": list(slicer_app.messages), "opened_declined": opened()}
buttons[0].click()
seen |= {"asked": asked, "opened": opened(), "messages": slicer_app.messages}
widget.cleanup()
print(json.dumps(seen))
sys.stdout.flush()
os._exit(0)
