"""Numbering the balls and recognising the poses of rings and mechanism (Eq. 4-19)."""
