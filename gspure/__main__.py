"""The process of ``gspure`` and ``python -m gspure``: an interruption ends it in one line, even while it imports."""

import gc
import signal
import sys

_interruptions: list[int] = []


def main() -> int:
    """Run one command; libraries that turn an interruption of their import into an error do not hide it."""
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:  # else ignored, as under `nohup`
        signal.signal(signal.SIGINT, _interrupt)
    try:
        from gspure import cli

        return cli.main()
    except BaseException:
        if not _interruptions:
            raise
        print("gspure: interrupted", file=sys.stderr)  # noqa: T201
        return 130
    finally:
        signal.signal(signal.SIGINT, signal.SIG_DFL)  # nothing is left to clean up
        gc.freeze()  # the exit would search all modules for cycles, a tenth of a second after scipy's import


def _interrupt(number: int, _frame: object) -> None:
    _interruptions.append(number)
    raise KeyboardInterrupt


if __name__ == "__main__":
    raise SystemExit(main())
