"""The process of ``gspure`` and ``python -m gspure``."""

import gc
import io
import os
import signal
import sys

_signals: list[int] = []


def main() -> int:
    """Run one command; a signal to stop, SIGTERM too, removes what is half done and ends it in one line."""
    if sys.stderr is None:  # it was closed; `print` would take standard output instead
        sys.stderr = os.fdopen(os.open(os.devnull, os.O_WRONLY), "w")
    if sys.stdout is None:
        print("gspure: standard output is closed; to discard it, use `> /dev/null`", file=sys.stderr)  # noqa: T201
        return 2
    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(errors="backslashreplace")  # a terminal or pipe may not take all characters
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        # `nohup` ignores SIGHUP; scripts ignore SIGINT for what runs in the background, but who sends one means it
        if number == signal.SIGINT or signal.getsignal(number) is not signal.SIG_IGN:
            signal.signal(number, _stop)
    try:
        from gspure import cli

        status = cli.main()
    except BaseException:  # libraries may replace an interruption of their import by an error
        if not _signals:
            raise
        print("gspure: interrupted", file=sys.stderr)  # noqa: T201
    gc.freeze()  # the exit would search all modules for cycles, a tenth of a second after scipy's import
    return 128 + _signals[0] if _signals else status


def _stop(number: int, _frame: object) -> None:
    _signals.append(number)
    raise KeyboardInterrupt


if __name__ == "__main__":
    sys.exit(main())
