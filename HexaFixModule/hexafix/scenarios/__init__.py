"""Numbered clinical scenarios, end to end: seeded phantoms brought as files, planned and judged.

Everything here is simulated; nothing says how well a hospital's scan would be read.
"""
