"""Window and level of the CT in the slice views: presets, numbers, and what a drag left."""

from __future__ import annotations

from typing import Any

PRESETS = {
    "bone": ("Bone", 2000.0, 500.0),
    "metal": ("Metal", 6000.0, 2000.0),
    "soft tissue": ("Soft tissue", 400.0, 40.0),
}
"""Window and level in HU; the image's own suggestion comes first in the menu."""

SUGGESTED = "suggested"

MOST_HU = 100_000
"""Beyond it a number was mistyped."""


class WindowLevel:
    """The one window and level of all slice views.

    Parameters
    ----------
    server : trame_server.Server
        Its state holds ``views_window`` and ``views_level`` in HU and ``views_preset``.
    """

    def __init__(self, server: Any) -> None:
        self._state = server.state
        self._display: Any = None
        self._tag: int | None = None
        self._suggested = PRESETS["bone"][1:]
        self._state.update(
            {
                "views_window": self._suggested[0],
                "views_level": self._suggested[1],
                "views_preset": SUGGESTED,
            }
        )

    def follow(self, display: Any, *, window_hu: float, level_hu: float) -> None:
        """Take over a volume's display node, starting at the suggested window and level.

        Parameters
        ----------
        display : vtkMRMLScalarVolumeDisplayNode
            The CT's display node.
        window_hu, level_hu : float
            What the image's values suggest.
        """
        self.let_go()
        self._display, self._suggested = display, (window_hu, level_hu)
        self.use(SUGGESTED)
        self._tag = display.AddObserver("ModifiedEvent", lambda *_: self._tell())

    def let_go(self) -> None:
        """Watch no display node any more."""
        if self._display is not None and self._tag is not None:
            self._display.RemoveObserver(self._tag)
        self._display = self._tag = None

    def use(self, preset: str) -> None:
        """Set a preset by name, or the suggested one."""
        window, level = self._suggested if preset == SUGGESTED else PRESETS[preset][1:]
        self.set(window, level)

    def ask(self, window_hu: Any, level_hu: Any) -> None:
        """Set what the user typed, if these are numbers; else show again what there is."""
        try:
            window, level = float(window_hu), float(level_hu)
        except (TypeError, ValueError):
            window = level = -1.0
        if self._display is None or (window, level) == self._shown_rounded():
            return
        if 0 < window <= MOST_HU and -MOST_HU <= level <= MOST_HU:
            self.set(window, level)
        else:
            self._tell()

    def set(self, window_hu: float, level_hu: float) -> None:
        """Set window and level in HU."""
        if self._display is None:
            return
        self._display.SetAutoWindowLevel(False)
        self._display.SetWindowLevel(window_hu, level_hu)
        self._tell()

    def _shown_rounded(self) -> tuple[int, int]:
        return round(self._display.GetWindow()), round(self._display.GetLevel())

    def _tell(self) -> None:
        shown = (self._display.GetWindow(), self._display.GetLevel())
        known = {name: preset[1:] for name, preset in PRESETS.items()}
        known[SUGGESTED] = self._suggested
        names = [name for name in (SUGGESTED, *PRESETS) if tuple(known[name]) == shown]
        with self._state:
            self._state.views_window, self._state.views_level = self._shown_rounded()
            self._state.dirty("views_window", "views_level")
            self._state.views_preset = names[0] if names else "own"
