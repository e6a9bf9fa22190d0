"""The page that `make torture` writes: what was tried, how often, and every defect that is open."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator
from pathlib import Path

from gspure.artifacts import write_text
from tests.hostile.journal import Record, kept

PAGE = Path(__file__).parents[2] / "benchmarks" / "torture.md"
GOAL = 0.85
"""Share of the mutants that tests must notice."""

ENDINGS = ("done", "refused", "crashed", "hangs")

INTRODUCTION = """\
# Torture

Written by `make torture`, which takes about three hours on two cores, goes on where it was stopped, and ends with an
error if a defect is open. A seeded part of it is in the test suite ([`tests/hostile`](../tests/hostile)). Each part can
be run alone and keeps its records, each with its commit, in [`benchmarks/torture/`](torture); `python -m tests.hostile
page` writes this page from them. What is expected:

- **Files.** Every reader gives a valid result or one printable line, whatever a file holds: no other exception, no
  crash, no warning, nothing written outside its folder, no program started, no pickle, at most 2 s of processor time
  and 192 MiB of memory. `python -m tests.hostile replay READER CASE` runs a case again.
- **Kills.** A job of every rule is killed with SIGKILL at random times while it works, and before random changes on
  disk. Its outputs are whole or absent, and a second run gives the bytes of an undisturbed one.
- **Want.** On a full disk, and under limits of file sizes and of memory, jobs leave nothing half-written, and give the
  same bytes afterwards. Without room on disk, they are refused in one line. Without address space, libraries may crash
  or hang, PoCL and OpenBLAS among them.
- **Corruption.** Whatever reads a corrupt artifact names it, and the next runs of the workflow repair it to the same
  bytes.
- **Mutants.** Tests notice small changes to the numerical core. `--sample` tries some of a module, drawn at random.
"""


PARTS = ("readers", "kills", "limits", "corruption", "together", "mutants", "drivers")


def write() -> bool:
    """Write the page from the records that are kept; return whether a defect is open."""
    readers, kills, limits, corruption, together, mutants, drivers = map(kept, PARTS)
    faults = [
        f"{part}: {r.get('rule') or r['case']}: {f}"
        for part, found in {"kills": kills, "want": limits, "corruption": corruption, "together": together}.items()
        for r in found
        for f in r["faults"]
    ]
    faults += [f"files: {v['reader']}, case {v['case']}: {v['kind']}" for r in readers for v in r["violations"]]
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
        *table(("reader", "mutated files", "broke the contract"), files(readers)),
        "\n## Kills\n",
        *table(("rule", "s", "changes on disk", "kills", "commit"), killed(kills)),
        "\n## Want\n",
        *table(("limit", "jobs", *ENDINGS), wanting(limits)),
        "\n## Corruption\n",
        f"Drawn at random from {sum(r.get('of', 0) for r in corruption)} pairs of a rule and a kind of artifact:\n",
        *table(("artifact", "corruptions", "named by the next reader", "not read by it"), corrupted(corruption)),
        "\nOne artifact of every kind at once:\n",
        *table(
            ("artifacts", "listed by `gspure stages --verify`", "runs until all are repaired"),
            ((r["corrupted"], r["reported"], r["runs"]) for r in corruption if "corrupted" in r),
        ),
        "\n## Together and moved\n",
        *(f"- {r['case']}: {'; '.join(r['faults']) or 'as it should'}" for r in together),
        "\n## Mutants\n",
        *table(
            ("module", "mutants", "tried", "noticed"),
            [(m["module"], m["of"], m["mutants"], f"{score(m)[0] / m['mutants']:.0%}") for m in mutants],
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


def score(record: Record) -> tuple[int, int]:
    return record["mutants"] - len(record["survivors"]), record["mutants"]


def files(found: list[Record]) -> Iterator[tuple[object, ...]]:
    cases, broken = Counter(), Counter()
    for record in found:
        cases[record["reader"]] += record["cases"]
        broken[record["reader"]] += len(record["violations"])
    yield from ((reader, f"{cases[reader]:,}", broken[reader]) for reader in cases)


def killed(found: list[Record]) -> Iterator[tuple[object, ...]]:
    for r in found:
        yield r["rule"], f"{r['seconds']:.1f}", r["changes"], sum(kill["hit"] for kill in r["kills"]), r["commit"]


def wanting(found: list[Record]) -> Iterator[tuple[object, ...]]:
    for kind in sorted({r["kind"] for r in found}):
        outcomes = Counter(r["outcome"] for r in found if r["kind"] == kind)
        yield kind, outcomes.total(), *(outcomes[ending] for ending in ENDINGS)


def corrupted(found: list[Record]) -> Iterator[tuple[object, ...]]:
    for kind in sorted({r["file"] for r in found if "file" in r}):
        outcomes = Counter(r["outcome"] for r in found if r.get("file") == kind)
        yield kind, outcomes.total(), outcomes["named"], outcomes["not read"]
