"""``python -m tests.hostile``: hostile files, kills, full disks, corruption; `make torture` runs all of it."""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
import time
import traceback
from collections import Counter
from collections.abc import Iterator
from dataclasses import asdict
from functools import partial
from importlib import import_module
from multiprocessing import get_context
from pathlib import Path

from gspure.progress import say
from tests.hostile.contract import Violation, Watch, prepared, run_case, torment
from tests.hostile.journal import Journal, Record, commit, keep
from tests.hostile.page import write
from tests.hostile.project import finished, jobs, rules
from tests.hostile.readers import BY_NAME, READERS

MEMORY_FOLDER = Path("/dev/shm")  # noqa: S108 -- files that live for a millisecond stay out of the disk's way
FOLDER = Path("build/torture")
CHUNK = 1000
WORKFLOW = ("kills", "limits", "corruption", "together")


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m tests.hostile", description=__doc__)
    parts = parser.add_subparsers(required=True)
    readers = parts.add_parser("readers", help="corrupt the files that readers read")
    readers.add_argument("--only", nargs="*", default=list(BY_NAME), metavar="READER")
    readers.add_argument("--cases", type=int, default=20_000, help="per reader (default: %(default)s)")
    readers.add_argument("--folder", type=Path, default=FOLDER, help="takes the records")
    readers.add_argument("--jobs", type=int, default=os.cpu_count())
    readers.set_defaults(run=corrupt_files)
    workflow = parts.add_parser("workflow", help="kill, starve and corrupt the jobs of every rule of the workflow")
    workflow.add_argument("--only", nargs="*", choices=WORKFLOW, default=WORKFLOW)
    workflow.add_argument("--rules", nargs="*", default=sorted(rules()), metavar="RULE")
    workflow.add_argument("--folder", type=Path, default=FOLDER)
    workflow.set_defaults(run=torture_workflow)
    drivers = parts.add_parser("drivers", help="compare every driver with the float64 reference")
    drivers.set_defaults(run=compare_drivers)
    page = parts.add_parser("page", help="write benchmarks/torture.md from the records in benchmarks/torture/")
    page.set_defaults(run=lambda _: write())
    replay = parts.add_parser("replay", help="run one case of a reader again, in this process")
    replay.add_argument("reader", choices=BY_NAME)
    replay.add_argument("case", type=int)
    replay.set_defaults(run=run_again)
    args = parser.parse_args()
    return int(args.run(args) or 0)


def corrupt_files(args: argparse.Namespace) -> bool:
    """Run all cases of all readers; records of earlier runs count."""
    os.environ["OMP_NUM_THREADS"] = "1"  # for PyTorch, as its threads do not survive a fork
    journal = Journal(args.folder / "readers")
    begun = time.monotonic()
    chunks = [
        (reader.name, start, min(start + CHUNK, args.cases))
        for start in range(0, args.cases, CHUNK)
        for reader in READERS
        if reader.available and reader.name in args.only
    ]
    violations: list[Violation] = []
    totals: dict[str, Record] = {}
    with get_context("fork").Pool(args.jobs, maxtasksperchild=1) as pool:
        records = pool.imap_unordered(partial(_chunk, journal), chunks, 1)
        for done, record in enumerate(records, start=1):
            violations += [Violation(**violation) for violation in record["violations"]]
            total = totals.setdefault(record["reader"], record | {"cases": 0, "endings": {}, "violations": []})
            total["cases"] += record["cases"]
            total["violations"] += record["violations"]
            for target, endings in record["endings"].items():
                total["endings"][target] = Counter(total["endings"].get(target, {})) + Counter(endings)
            progress = f"{done}/{len(chunks)}, {time.monotonic() - begun:.0f} s"
            say(f"{progress}: {record['reader']}: {len(record['violations'])} violations")
    if args.folder == FOLDER:  # those of another folder are a trial
        keep("readers", totals.values(), partial=True)
    say("\n".join(_summary(violations)))
    return bool(violations)


def _chunk(journal: Journal, chunk: tuple[str, int, int]) -> Record:
    name, start, stop = chunk
    try:
        return journal.record(f"{name}.{start}.{stop}", _tormented, name, start, stop)
    except Exception:  # noqa: BLE001 -- not every exception survives the way between processes, and no traceback
        raise RuntimeError(f"{name}, cases {start} to {stop}: {traceback.format_exc()}") from None


def _tormented(name: str, start: int, stop: int) -> Record:
    with tempfile.TemporaryDirectory(dir=MEMORY_FOLDER if MEMORY_FOLDER.is_dir() else None) as folder:
        cases = list(torment(BY_NAME[name], range(start, stop), Path(folder).resolve() / "reader"))
    endings = {
        target: Counter(c.ending for c in cases if c.target == target) for target in sorted({c.target for c in cases})
    }
    violations = [asdict(violation) for case in cases for violation in case.violations]
    return {"reader": name, "cases": stop - start, "endings": endings, "violations": violations}


def _summary(violations: list[Violation]) -> Iterator[str]:
    """Yield a line for each kind of violation, with the first case of it."""
    first = {violation.signature: violation for violation in reversed(violations)}
    for signature, count in Counter(violation.signature for violation in violations).most_common():
        v = first[signature]
        case = f"case {v.case} ({v.mutation} of {v.target})"
        yield f"{count:6} {v.reader}: {v.kind} {v.place}, {case}: {v.detail[:160]!r}"
    yield f"{len(violations)} violations"


def torture_workflow(args: argparse.Namespace) -> bool:
    """Run the workflow once, then its jobs under all kinds of trouble; corrupt the files of every scheme."""
    os.environ["OMP_NUM_THREADS"] = "1"  # as for readers
    references = {"project": finished(args.folder.resolve() / "project")}
    if missing := rules() - {job.rule for job in jobs(references["project"])}:
        raise SystemExit(f"the project runs no job of {', '.join(sorted(missing))}")
    if "corruption" in args.only:
        references["schemes"] = finished(args.folder.resolve() / "schemes")
    faults = 0
    with tempfile.TemporaryDirectory() as scratch:
        for part in args.only:
            run, records = import_module(f"tests.hostile.{part}").run, []
            for name in references if part == "corruption" else ("project",):
                journal = Journal(args.folder / part / name)
                for record in run(journal, references[name], Path(scratch).resolve(), args.rules):
                    records.append(record)
                    faults += len(record["faults"])
                    result = "; ".join(record["faults"])[:300] or "as it should"
                    say(f"{part}: {record.get('rule') or record['case']}: {result}")
            if args.folder == FOLDER:
                keep(part, records, partial={*args.rules} != rules())
    return bool(faults)


def compare_drivers(_: argparse.Namespace) -> None:
    """Measure the errors of every driver."""
    from benchmarks.drivers import rows

    keep("drivers", [{**row, "commit": commit()} for row in rows()])


def run_again(args: argparse.Namespace) -> None:
    """Show what one case does."""
    with tempfile.TemporaryDirectory() as folder:
        reader = BY_NAME[args.reader]
        pristine, work = prepared(reader, Path(folder).resolve() / "reader")
        case = run_case(reader, args.case, pristine, work, Watch())
    say("\n".join([f"{case.target}: {case.ending}", *map(str, case.violations)]))


if __name__ == "__main__":
    sys.exit(main())
