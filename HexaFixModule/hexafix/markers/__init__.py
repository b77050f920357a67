"""Finding the marker balls in a volume and fitting their centres."""

from hexafix.markers.ball import Ball, BallSet, Rejected

__all__ = ["Ball", "BallSet", "Rejected"]
