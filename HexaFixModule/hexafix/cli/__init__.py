"""The command line door: options in, exit code out; no arithmetic.

`main` is all that runs at start; each command imports what it needs when it is called, so that
``hexafix --help`` answers at once.
"""

from hexafix.cli.app import main

__all__ = ["main"]
