"""The one error family of HexaFix.

Every error carries one or more `Fault` values: what is wrong, the value met, the limit it
broke, the next step and the hazard id. Doors turn an error into an exit code, a dialog or a
banner in one place each; nothing else formats faults.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar, Self


@dataclass(frozen=True, slots=True)
class Fault:
    """One thing that is wrong.

    Attributes
    ----------
    code : str
        Stable kebab-case name for scripts, e.g. ``missing-slice``.
    what : str
        What is wrong, one sentence without the numbers below.
    value, limit : str or None
        The value met and the limit it broke, with unit.
    next_step : str or None
        What the user can do about it.
    hazard : str or None
        Row of the hazard table, e.g. ``H03``.
    where : str or None
        JSON path, file or option concerned.
    """

    code: str
    what: str
    value: str | None = None
    limit: str | None = None
    next_step: str | None = None
    hazard: str | None = None
    where: str | None = None

    @property
    def message(self) -> str:
        """The whole fault as one line for people."""
        text = f"{self.where}: {self.what}" if self.where else self.what
        if self.value is not None:
            text += f" (value {self.value}" + (f", limit {self.limit})" if self.limit else ")")
        elif self.limit is not None:
            text += f" (limit {self.limit})"
        if self.next_step:
            text += f". Next step: {self.next_step}"
        return text

    def as_json(self) -> dict[str, Any]:
        """The fault as the JSON object the command line prints."""
        document: dict[str, Any] = {"hazard": self.hazard, "code": self.code}
        document["message"] = self.message
        for key in ("where", "value", "limit", "next_step"):
            if getattr(self, key) is not None:
                document[key] = getattr(self, key)
        return document


class HexaFixError(Exception):
    """Base of every error that HexaFix raises on purpose.

    Parameters
    ----------
    *faults : Fault
        All faults found, at least one.
    """

    exit_code: ClassVar[int] = 1

    def __init__(self, *faults: Fault) -> None:
        if not faults:
            raise TypeError("an error needs at least one Fault")
        super().__init__("; ".join(fault.message for fault in faults))
        self.faults: tuple[Fault, ...] = faults

    @classmethod
    def of(cls, code: str, what: str, **details: str | None) -> Self:
        """Error with a single fault; `details` are the other fields of `Fault`."""
        return cls(Fault(code, what, **details))

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), self.faults


class InputError(HexaFixError, ValueError):
    """The command line, a file or the case is wrong (exit code 2)."""

    exit_code = 2


class HardwareDefinitionError(InputError):
    """A hardware definition is wrong."""


class MissingLibrary(HexaFixError, ImportError):
    """An optional library is not installed; the message names the feature and the extra."""

    exit_code = 2


class Refused(HexaFixError):
    """A safety gate refused; nothing was written (exit code 3)."""

    exit_code = 3


class SelfTestFailed(Refused):
    """An installed library does not give the known answer; the message names it (H54)."""


class ImageRefused(Refused, ValueError):
    """The image's geometry or content cannot be trusted."""


class MarkersNotFound(Refused):
    """The balls that the layout asks for are not in the image."""


class NumberingAmbiguous(Refused):
    """More than one assignment of numbers to balls fits."""


class LayoutRejected(Refused):
    """The marker layout breaks a rule."""


class ForwardKinematicsDiverged(Refused, ArithmeticError):
    """Newton did not reach the pose of the given strut lengths."""


class StrutOutOfRange(Refused, ValueError):
    """A strut would leave its stroke."""


class Cancelled(HexaFixError):
    """The user stopped the work; nothing was written."""

    exit_code = 2
