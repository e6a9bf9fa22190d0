"""The page that `make torture` writes: what was tried, how often, and every defect that is open."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator
from pathlib import Path

from gspure.artifacts import write_text
from tests.hostile.contract import CHECKSUM, READ, REFUSED
from tests.hostile.journal import Record, kept

PAGE = Path(__file__).parents[2] / "benchmarks" / "torture.md"
LARGEST_ERROR = 1e-4
"""Of a driver, against the float64 reference."""

GOAL = 0.85
"""Share of the mutants that tests must notice."""

ENDINGS = ("done", "refused", "crashed", "hangs")
ENDINGS_OF_FILES = (READ, REFUSED, CHECKSUM)

INTRODUCTION = """\
# Torture

`make torture` runs these tests and writes this page. It takes about three hours on two cores, continues where it was
stopped, and ends with an error if a defect is open. The test suite runs a small part with fixed random seeds
([`tests/hostile`](../tests/hostile)). Each part can also be run alone. Its records, each with its commit, are in
[`benchmarks/torture/`](torture); `python -m tests.hostile page` writes this page from them. The contract:

- **Files.** Every reader gives a valid result or refuses the file in one printable line, whatever the file holds: no
  other exception, no crash, no warning, nothing written outside its folder, no program started, no pickle, at most 2 s
  of processor time and 192 MiB of memory. A file is refused by checksum if it did not reach its parser. No column
  counts files that the mutation left as they were; early records have no counts (–). `python -m tests.hostile replay
  READER CASE` runs a case again.
- **Kills.** A job of every rule is killed with SIGKILL at random times, and before random changes on disk. If the job
  ends before the kill, the kill is tried again, earlier. Outputs are whole or absent, and a second run gives the same
  bytes as an undisturbed one.
- **Want.** On a full disk, and under limits of file sizes and of memory, jobs leave nothing half-written, and give the
  same bytes when they run again without limits. Without room on disk, they end with one line. Without address space,
  libraries such as PoCL and OpenBLAS may crash or hang.
- **Corruption.** Every rule runs with each kind of artifact that it reads, corrupted. If the rule opens the file, it
  ends with a line that names the file, and changes nothing. The next runs of the workflow repair the file to the same
  bytes. Then the artifact is *forged*: mutated, with a checksum that fits. The rule makes a result, or refuses the
  artifact in one line. Artifacts that the rule neither opens nor refuses are not forged.
- **Drivers.** Errors against the float64 reference are at most 1e-4.
- **Mutants.** Tests notice small changes to the numerical core. `--sample` tries a random part of a module's mutants.
"""


PARTS = ("readers", "kills", "limits", "corruption", "together", "mutants", "drivers")


def write() -> bool:
    """Write the page from the records that are kept; return whether a defect is open."""
    readers, kills, limits, corruption, together, mutants, drivers = map(kept, PARTS)
    faults = [
        f"{part}: {r.get('rule') or r['case']}: {f}"
        for part, records in {"kills": kills, "want": limits, "corruption": corruption, "together": together}.items()
        for r in records
        for f in r["faults"]
    ]
    faults += [f"files: {v['reader']}, case {v['case']}: {v['kind']}" for r in readers for v in r["violations"]]
    faults += [f"driver {d['driver']}, {d['style']}: {name} {d[name]}" for d in drivers for name in off(d)]
    noticed, changed = sum(score(m)[0] for m in mutants), sum(score(m)[1] for m in mutants)
    if changed and noticed < GOAL * changed:
        faults.append(f"mutants: {noticed / changed:.0%} are noticed, fewer than {GOAL:.0%}")
    parts = [
        INTRODUCTION,
        "## Totals\n",
        *table(
            ("what", "number"),
            [
                ("mutated files", f"{sum(r['cases'] for r in readers):,}"),
                ("readers", len({r["reader"] for r in readers})),
                ("kills that hit a job at work", sum(k["hit"] for r in kills for k in r["kills"])),
                ("rules killed", len(kills)),
                ("jobs in want of disk or memory", len(limits)),
                ("corrupt artifacts", sum(r.get("corrupted", 1) for r in corruption)),
                ("forged artifacts", sum(sum(r["forged"].values()) for r in corruption if "forged" in r)),
                ("mutants noticed", f"{noticed} of {changed} ({noticed / changed:.1%})" if changed else "none tried"),
                ("open defects", len(faults)),
            ],
        ),
        "\n## Commits\n",
        *table(("part", "cases at commits"), ((part, commits(part)) for part in PARTS)),
        "\n`A to B`: at commits from A to B, of which each part had no record of its own.\n",
        "## Open defects\n",
        *([f"- {fault[:300]}" for fault in faults] or ["None."]),
        "\n## Files\n",
        *table(("reader", "commit", "mutated files", *ENDINGS_OF_FILES, "broke the contract"), files(readers)),
        "\n## Kills\n",
        *table(("rule", "s", "changes on disk", "kills", "commit"), killed(kills)),
        "\n## Want\n",
        *table(("limit", "jobs", *ENDINGS), wanting(limits)),
        "\n## Corruption\n",
        "Every pair of a rule and a kind of artifact that it may read:\n",
        *table(("artifact", "corrupted", "named", "not opened", "forged", "read", "refused"), corrupted(corruption)),
        "\nOne artifact of every kind at once:\n",
        *table(
            ("artifacts", "listed by `gspure stages --verify`", "runs until all are repaired"),
            ((r["corrupted"], r["reported"], r["runs"]) for r in corruption if "corrupted" in r),
        ),
        "\n## Together and moved\n",
        *(f"- {r['case']}: {'; '.join(r['faults']) or 'as it should'}" for r in together),
        "\n## Mutants\n",
        *table(
            ("module", "mutants", "tried", "noticed", "commit"),
            [(m["module"], m["of"], m["mutants"], f"{score(m)[0] / m['mutants']:.0%}", m["commit"]) for m in mutants],
        ),
        "\nSurvivors:\n",
        *(
            f"- `{m['module']}`, line {s['line']}, {s['change']}: `{s['source']}`"
            for m in mutants
            for s in m["survivors"]
        ),
        "\n## Drivers\n",
        "Largest errors against the float64 reference ([numerics](../docs/numerics.md)):\n",
        *table(
            (
                "driver",
                "kernel style",
                "image, worst pixel",
                "contributions per pixel, mean of rows",
                "gradients, worst row",
            ),
            ((r["driver"], r["style"], r["image"], r["contributions"], r["gradients"]) for r in drivers),
        ),
    ]
    write_text(PAGE, "\n".join(map(str, parts)).rstrip() + "\n")
    return bool(faults)


def table(header: tuple[str, ...], rows: Iterable[tuple[object, ...]]) -> Iterator[str]:
    yield f"| {' | '.join(header)} |"
    yield "| --- " * len(header) + "|"
    for row in rows:
        yield f"| {' | '.join(map(str, row))} |"


def commits(part: str) -> str:
    """How many cases of a part ran at each commit."""
    return ", ".join(f"{count} at {commit}" for commit, count in Counter(r["commit"] for r in kept(part)).most_common())


def off(driver: Record) -> list[str]:
    """Return the products in which a driver is wrong."""
    return [name for name in ("image", "contributions", "gradients") if not float(driver[name]) <= LARGEST_ERROR]


def score(record: Record) -> tuple[int, int]:
    return record["mutants"] - len(record["survivors"]), record["mutants"]


def files(records: list[Record]) -> Iterator[tuple[object, ...]]:
    for r in sorted(records, key=lambda r: r["reader"]):
        endings = sum(map(Counter, r.get("endings", {}).values()), Counter())
        counts = (f"{endings[ending]:,}" if endings else "–" for ending in ENDINGS_OF_FILES)
        yield r["reader"], r["commit"], f"{r['cases']:,}", *counts, len(r["violations"])


def killed(records: list[Record]) -> Iterator[tuple[object, ...]]:
    for r in records:
        yield r["rule"], f"{r['seconds']:.1f}", r["changes"], sum(kill["hit"] for kill in r["kills"]), r["commit"]


def wanting(records: list[Record]) -> Iterator[tuple[object, ...]]:
    for kind in sorted({r["kind"] for r in records}):
        outcomes = Counter(r["outcome"] for r in records if r["kind"] == kind)
        yield kind, outcomes.total(), *(outcomes[ending] for ending in ENDINGS)


def corrupted(records: list[Record]) -> Iterator[tuple[object, ...]]:
    for kind in sorted({r["file"] for r in records if "file" in r}):
        alike = [r for r in records if r.get("file") == kind]
        outcomes = Counter(r["outcome"] for r in alike)
        forged = sum((Counter(r.get("forged", {})) for r in alike), Counter())
        yield (
            kind,
            len(alike),
            outcomes["named"],
            outcomes["not opened"] + outcomes["not read"],  # its name in early records
            *(forged.total(), forged["read"], forged["refused"]),
        )
