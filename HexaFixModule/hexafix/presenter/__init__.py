"""The workflow of a workstation, without any toolkit: browser, Qt and Slicer show one `Presenter`.

A door shows `Presenter.snapshot`, a frozen value in which every text is ready to be read, follows
`Presenter.changed`, and calls the presenter's actions. No door computes, and neither does this
room: every value comes from `hexafix.pipeline`.

**One document.** All that the user edits is the case document, the JSON of ``case.json``. Each edit
makes one version of its bytes with a label; undo and redo change the version and nothing else. A
case that was not edited keeps its bytes, so that its export is the command line's to the last byte.

**Steps.** Each result is kept under the hash of exactly what it depends on, never under a mark that
somebody must remember to take away (H40):

========== ===================================================== ==============
step       depends on                                            computed
========== ===================================================== ==============
load       image path, series, the files' size and time          by run
markers    content of the image, ball diameter; marker edits     by run; live
numbering  the same; layouts, numbers assigned, and the readings live
           where the layouts leave a choice
poses      the same; limb, fixator, relaxed layout accepted      by run
readings   poses, readings, fixator                              live
correction poses, correction, readings, schedule                 live
schedule   poses, every byte of the case, the fixator's file     by run
export     the same                                              by run
========== ===================================================== ==============

"Live" steps take milliseconds and follow each edit at once where what they need is done; edits of
balls reuse the one search. `Presenter.run` computes a step with all before it that is not done,
always of the case as it is then: an edit meanwhile ends the step that it concerns and no other.

**States.** waiting: something it needs is missing or wrong in the case. ready: it can be run.
running. done: its result is of the present inputs and nothing refuses it. stale: what is shown is
of older inputs, grey; undo makes it done again without computing. refused: the present inputs are
refused or wrong; the banners say why and what to do, and older results stay, grey.

An export needs all eight steps done, and three answers: the side said a second time for this CT
(H37), readings that were typed here entered a second time (H24), and, where the case holds that
question, the rings' front confirmed (H22).

**Scenes.** A scene's file is opened as a case whose CT lies in that file (`scenes`); the door gives
the reader. It is read whole on the working thread; the open case is replaced last, or stays.

**Threads.** Long steps work on one thread of their own; `post` brings each new snapshot to the
door's thread. Stopping them leaves older results as they are. Actions never raise: they return
whether they were done, and what was wrong is a banner; a defect is told by its type and place,
since its text could hold patient data (H51).
"""

from hexafix.presenter.presenter import Presenter
from hexafix.presenter.state import Banner, Snapshot, Step, StepState, StepView, Table

__all__ = ["Banner", "Presenter", "Snapshot", "Step", "StepState", "StepView", "Table"]
