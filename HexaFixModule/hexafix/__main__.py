"""``python -m hexafix``."""

from hexafix.cli import main

if __name__ == "__main__":
    main()
