"""A finished export recomputed by another road: other formulas, other libraries.

Nothing here uses `hexafix.recognition`, `hexafix.kinematics` or `hexafix.correction`: ring poses
and mechanism come from `scipy.optimize`, the path from matrix exponentials, the printed numbers
from the text that another program reads out of the PDF.
"""

from hexafix.verify.check import Check
from hexafix.verify.export_folder import verify_export
from hexafix.verify.printed import check_printed
from hexafix.verify.recompute import Recomputed, recompute

__all__ = ["Check", "Recomputed", "check_printed", "recompute", "verify_export"]
