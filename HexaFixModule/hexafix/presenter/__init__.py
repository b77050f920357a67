"""The workflow of a workstation, without any toolkit."""

from hexafix.presenter.presenter import Presenter
from hexafix.presenter.state import Banner, Snapshot, Step, StepState, StepView, Table

__all__ = ["Banner", "Presenter", "Snapshot", "Step", "StepState", "StepView", "Table"]
