"""`python -m scenarios` is `hmtb`."""

import sys

from scenarios.commands.cli import main

if __name__ == "__main__":
    sys.exit(main())
