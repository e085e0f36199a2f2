"""The command `stickslip`, also as ``python -m stickslip``."""

import signal
import sys
from pathlib import Path

from ._stickslip import main as run_command


def main():
    # As for any other program, a reader that leaves is no error of Python's, and Ctrl-C is the program's.
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    program = Path(sys.argv[0]).absolute()
    sys.exit(run_command(program, ["stickslip", *sys.argv[1:]]))


if __name__ == "__main__":
    main()
