"""What jobs cost: CPU time and peak memory, in a small JSON file beside the log of each.

The cost of ``attack.log`` is in ``attack.cost.json``. It differs from run to run, so no record of an artifact
holds its checksum, and no job depends on it.
"""

import resource
from collections.abc import Iterable
from pathlib import Path
from typing import Final, NamedTuple

from gspure.errors import InputError

SUFFIX: Final = ".cost.json"

LOG: Final = "GSPURE_LOG"  # environment variable with the log of the job that runs a command
COSTS: Final = "results/benchmarks"  # of attacks with their measurements: `SCHEME/SCENE/VARIANT/attack.cost.json`


class Cost(NamedTuple):
    """The cost of a job, or of several one after the other."""

    cpu: float  # CPU time of all threads, s
    memory: float  # peak memory, MiB

    def write(self, path: Path) -> None:
        """Write a JSON file."""
        from gspure.artifacts import write_json

        write_json(path, self._asdict())


def spent() -> Cost:
    """Return what this process and its finished children have cost so far."""
    usage = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return Cost(sum(u.ru_utime + u.ru_stime for u in usage), max(u.ru_maxrss for u in usage) / 1024)


def total(costs: Iterable[Cost]) -> Cost:
    """Return the cost of jobs one after the other."""
    cpu, memory = zip(*costs, strict=True)
    return Cost(sum(cpu), max(memory))


def cost_of(log: str | Path) -> Path:
    """Return where the cost of the job with this log is recorded."""
    return Path(log).with_suffix(SUFFIX)


def read_cost(path: Path) -> Cost:
    """Read a cost, or raise `InputError` if the file holds anything else."""
    from gspure.artifacts import read_json

    match read_json(path):
        case {"cpu": float(cpu), "memory": float(memory)}:
            return Cost(cpu, memory)
    raise InputError(path, "file", expected="the cost of a job", found="other JSON")
