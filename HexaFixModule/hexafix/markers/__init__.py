"""Finding the marker balls in a volume and fitting their centres."""

from hexafix.markers.ball import Ball, BallSet, Rejected
from hexafix.markers.find import find_balls

__all__ = ["Ball", "BallSet", "Rejected", "find_balls"]
