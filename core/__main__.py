"""`python -m core COMMAND ...`"""

from __future__ import annotations

import sys

INTERRUPTED = 130  # What a shell reports of a command that Ctrl-C has ended.

if __name__ == "__main__":
    try:
        from .cli.main import main  # The imports take half a second, in which Ctrl-C may come as well.

        sys.exit(main())
    except KeyboardInterrupt:
        sys.exit(INTERRUPTED)
