"""From a recognised pose to a strut schedule (Eq. 31, 32 and beyond)."""
