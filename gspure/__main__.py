"""The process of ``gspure`` and ``python -m gspure``."""

import gc
import io
import signal
import sys

_signals: list[int] = []


def main() -> int:
    """Run one command; a signal to stop, SIGTERM too, removes what is half done and ends it in one line."""
    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(errors="backslashreplace")  # a terminal or pipe may not take all characters
    for number in (signal.SIGINT, signal.SIGTERM):
        if signal.getsignal(number) is not signal.SIG_IGN:  # as by `nohup`
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
