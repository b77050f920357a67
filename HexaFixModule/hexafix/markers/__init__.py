"""Finding the marker balls in a volume, fitting their centres, and the user's corrections."""

from hexafix.markers.ball import Ball, BallSet, Rejected
from hexafix.markers.edit import MarkerEdits, edited_balls
from hexafix.markers.find import find_balls

__all__ = ["Ball", "BallSet", "MarkerEdits", "Rejected", "edited_balls", "find_balls"]
