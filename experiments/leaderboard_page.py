"""The leaderboard of the documentation site: schemes by the robust radius of their message.

Its data are the records ``leaderboard/*.json`` (`gspure.evaluation.radius.Record`).
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from html import escape
from math import isnan
from pathlib import Path
from typing import NamedTuple

from gspure.codec import read
from gspure.evaluation.radius import Kind, Radius, Record
from gspure.evaluation.results import ADAPTS, PUBLISHED, OwnerName
from gspure.files import read_json
from gspure.grouping import grouped
from gspure.metrics.image_metrics import DAMAGE_TOLERANCE
from gspure.metrics.names import display_name
from gspure.report.audit import BROKEN, WEAK

RECORDS = Path(__file__).parent / "leaderboard"
UNKNOWN = "–"

PAGE = """\
---
hide: [toc]
---

# Leaderboard

The *robust radius* of a message is the least damage to the scene, in dB of PSNR, after which its owner can no
longer [prove](statistics.md#proof) it; the *readable radius*, after which nobody can read it. Schemes are ranked by the
message radius of the owner who adapts. Compare rows of one *suite*, a named list of attacks, only. The *killer* is the
attack that ends the message. Click on a title to sort.

{table}

<p class="legend"><span class="broken">broken: at most 1 dB</span> <span class="weak">weak: at most 2 dB</span>
<span class="holds">holds</span></p>

*No mark, row matching*: whether a file descends from the owner's can be told without any mark, by comparing rows. This
baseline, *descent*, is not measured yet.

## Add a scheme

1. Register the scheme as a [plug-in](extending.md), or your decoder as a [detector](configuration.md#detectors).
2. Write a [configuration](configuration.md) with your scheme and its pairs, and run `gspure audit CONFIG.yaml`.
3. Write its record with `gspure submit results --out experiments/leaderboard/NAME.json`.
4. `make docs`, look at this page, and open a pull request.
"""

NO_RECORD = "**There is no record yet.**"


class Line(NamedTuple):
    """One condition of a record."""

    record: Record
    alike: tuple[Radius, ...]

    def radius(self, kind: Kind, owner: OwnerName) -> Radius | None:
        """Return the radius of an owner; where the scheme has no extraction that adapts, the owner is as published."""
        of_owner = {one.owner: one for one in self.alike if one.kind == kind}
        return of_owner.get(owner, of_owner.get(PUBLISHED))

    @property
    def rank(self) -> tuple[float, bool]:
        """What lines are sorted by: the message radius, one that exceeds it above; unknown ones last."""
        one = self.radius("message", ADAPTS)
        return (-1.0, False) if one is None or isnan(one.radius) else (one.radius, one.exceeds)


def page() -> str:
    """Return the page as Markdown with a table in HTML."""
    records = [read(Record, read_json(file), file) for file in sorted(RECORDS.glob("*.json"))]
    return PAGE.format(table=table(records) if records else NO_RECORD)


def table(records: Iterable[Record]) -> str:
    """Return the table of all conditions, the most robust first."""
    lines = [Line(record, tuple(alike)) for record in records for alike in _by_condition(record)]
    titles = ["scheme", "poses", "suite", "scenes", "message, adaptive", "message, as published", "readable", "killer"]
    head = "".join(f"<th>{title}</th>" for title in titles)
    body = ""
    for line in sorted(lines, key=lambda line: line.rank, reverse=True):
        cells = [
            cell.replace("<td", f'<td data-title="{title}"', 1)
            for title, cell in zip(titles, _cells(line), strict=True)
        ]
        body += f"<tr>{''.join(cells)}</tr>"
    return f'<table class="leaderboard"><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>'


def _by_condition(record: Record) -> Iterable[list[Radius]]:
    return grouped(record.conditions, lambda one: one.condition).values()


def _cells(line: Line) -> Iterator[str]:
    """Yield the cells of one condition."""
    condition = line.alike[0].condition
    adaptive = line.radius("message", ADAPTS)
    yield f"<td>{escape(display_name(condition.scheme))}</td>"
    yield f"<td>{escape(condition.protocol or UNKNOWN)}</td>"
    yield f"<td>{escape(line.record.suite)}</td>"
    yield f"<td>{max(one.scenes for one in line.alike)}</td>"
    yield _radius_cell(adaptive)
    yield _radius_cell(line.radius("message", PUBLISHED))
    yield _radius_cell(line.radius("readable", ADAPTS))
    yield f"<td>{escape(killer_title(adaptive)) if adaptive else UNKNOWN}</td>"


def _radius_cell(one: Radius | None) -> str:
    """Return the cell of a radius, in the colour of its verdict."""
    if one is None or isnan(one.radius):
        return f'<td data-sort="-1">{UNKNOWN}</td>'
    return f'<td class="{_verdict(one)}" data-sort="{one.radius:.3f}">{escape(str(one))}</td>'


def _verdict(one: Radius) -> str:
    """Return the verdict that follows from a radius, as in an audit; empty if too little damage was tried."""
    if one.exceeds:
        return "holds" if one.radius >= BROKEN else ""
    if one.radius > WEAK + DAMAGE_TOLERANCE:
        return "holds"
    return "broken" if one.radius <= BROKEN + DAMAGE_TOLERANCE else "weak"


def killer_title(radius: Radius) -> str:
    """Return the display name of the attack that ends a message, with the damage that was searched for."""
    entry, _, wanted = radius.killer.partition("@")
    return ", ".join(filter(None, [display_name(entry), wanted.replace("dB", " dB")])) or UNKNOWN
