"""Python imports this at its start: it counts the changes that a job makes on disk, or ends the job at one of them.

``HOSTILE_COUNT`` names a file that gets one byte for each change. ``HOSTILE_KILL`` is the change, counted from 1,
before which the whole process group is killed. Changes are those below ``HOSTILE_FOLDER``.
"""

import itertools
import os
import signal
import sys

_WRITES = os.O_WRONLY | os.O_RDWR | os.O_CREAT | os.O_TRUNC | os.O_APPEND
_CHANGES = {"os.mkdir": 0, "os.rename": 1, "os.remove": 0, "os.rmdir": 0, "os.symlink": 1, "os.link": 1}
_FOLDER = os.environ.get("HOSTILE_FOLDER")
_COUNT = os.environ.get("HOSTILE_COUNT")
_KILL = int(os.environ.get("HOSTILE_KILL", "0"))
_seen = itertools.count(1)


def _watch(event, arguments):
    if event == "open" and isinstance(arguments[2], int) and arguments[2] & _WRITES:
        path = arguments[0]
    elif event in _CHANGES:
        path = arguments[_CHANGES[event]]
    else:
        return
    if not isinstance(path, str | os.PathLike) or not os.path.realpath(path).startswith(_FOLDER):
        return
    if next(_seen) == _KILL:
        os.killpg(0, signal.SIGKILL)
    if _COUNT:
        os.write(_counter, b".")


if _FOLDER:
    if _COUNT:
        _counter = os.open(_COUNT, os.O_WRONLY | os.O_APPEND | os.O_CREAT, 0o600)
    sys.addaudithook(_watch)
