"""The command ``areograph``."""

import os
import shutil
import signal
import sys

from . import _native


def main() -> int:
    """Run the command line of this process and return its exit code."""
    # The interpreter would only note Ctrl-C and handle it after the command.
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    return _native.main(["areograph", *sys.argv[1:]], program())


def program() -> str:
    """Return the file that starts this command: the service starts its own processes with it."""
    started = sys.argv[0]
    if os.path.basename(started) == "areograph":
        return os.path.abspath(started)
    beside = os.path.join(os.path.dirname(sys.executable), "areograph")
    return beside if os.access(beside, os.X_OK) else shutil.which("areograph") or beside


if __name__ == "__main__":
    sys.exit(main())
