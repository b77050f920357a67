"""Seeded synthetic CT of a fixator on a limb, with exact truth."""
