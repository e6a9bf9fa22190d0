"""The process of ``gspure`` and ``python -m gspure``: a signal to stop ends it in one line, even while it imports."""

import gc
import os
import signal
import sys
from pathlib import Path

_signals: list[int] = []


def main() -> int:
    """Run one command; libraries that turn an interruption of their import into an error do not hide it.

    SIGTERM, too, removes what is half done; for process 1 of a container it would not even end the process.
    """
    for name in ("stdout", "stderr"):
        if getattr(sys, name) is None:  # closed, as by `2>&-`
            setattr(sys, name, Path(os.devnull).open("w", encoding="utf-8"))  # noqa: SIM115
    numbers = [n for n in (signal.SIGINT, signal.SIGTERM) if signal.getsignal(n) is not signal.SIG_IGN]  # as by `nohup`
    for number in numbers:
        signal.signal(number, _stop)
    try:
        from gspure import cli

        status = cli.main()
        return 128 + _signals[0] if _signals else status
    except BaseException:
        if not _signals:
            raise
        print("gspure: interrupted", file=sys.stderr)  # noqa: T201
        return 128 + _signals[0]
    finally:
        for number in numbers:
            signal.signal(number, signal.SIG_DFL)  # nothing is left to clean up
        gc.freeze()  # the exit would search all modules for cycles, a tenth of a second after scipy's import


def _stop(number: int, _frame: object) -> None:
    _signals.append(number)
    raise KeyboardInterrupt


if __name__ == "__main__":
    raise SystemExit(main())
