"""`python -m yawbench`: the command line."""

import os
import sys


def main() -> None:
    """Run the command line; help and version of the program need nothing of it."""
    if "_YAWBENCH_COMPLETE" not in os.environ and {*sys.argv[1:2]} <= {"--version", "-h", "--help"}:
        from .command_help import answer

        if (text := answer(sys.argv[1:])) is not None:
            try:
                print(text, flush=True)
            except OSError:  # the reader closed the pipe
                os._exit(1)
            os._exit(0)
    from .cli import main as command_line

    command_line()


if __name__ == "__main__":
    main()
