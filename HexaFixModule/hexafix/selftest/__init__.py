"""Known cases against the installed libraries, before a prescription relies on them (H54)."""

from hexafix.selftest.check import Check, Outcome
from hexafix.selftest.run import require_self_test, run_self_test, self_test_document

__all__ = ["Check", "Outcome", "require_self_test", "run_self_test", "self_test_document"]
