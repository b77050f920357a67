"""Seeded synthetic CT of a fixator on a limb, with exact truth."""

from hexafix.phantom.make import Phantom, make_phantom
from hexafix.phantom.spec import PhantomSpec
from hexafix.phantom.variety import random_spec
from hexafix.phantom.write import write_phantom

__all__ = ["Phantom", "PhantomSpec", "make_phantom", "random_spec", "write_phantom"]
