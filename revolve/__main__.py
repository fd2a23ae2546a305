"""``python -m revolve``: the command ``revolve``."""

import sys

from revolve.command import main

if __name__ == "__main__":
    sys.exit(main())
