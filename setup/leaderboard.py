"""The leaderboard of the documentation site: the damage to the scene at which each attack removes each message.

Its data are every ``docs/results/RUN/survival.csv``, a copy of ``results/tables/survival.csv`` of a run.
``python setup/leaderboard.py RESULTS``, in a checkout, draws its pictures from the results of config/six_pairs.yaml.
"""

from __future__ import annotations

import sys
from collections.abc import Iterable, Iterator
from html import escape
from math import inf
from pathlib import Path

from gspure.evaluation.survival import Survival
from gspure.grouping import grouped
from gspure.metrics.csv_tables import read_table
from gspure.metrics.names import UNATTACKED, display_name, extraction_name
from gspure.text import decimal

RESULTS = Path(__file__).parents[1] / "docs" / "results"
EXCLUDED = {"objects", "readings"}  # runs that vary GSPure and the scene, not the attack
EQUAL = {
    "gspure_equal": "gspure",
    "gof_equal": "gof",
    "random_equal": "random_pruning",
    "noise_equal": "gaussian_noise",
}
BANDS = (0.3, 1.0, 2.0)  # damage in dB; a message lost at 1 dB or less is broken, at 2 dB or less weak

PICTURED = "six_pairs"  # the run of the pictures
MODEL = "rooms_shared"  # one of its scenes
VIEW = "view_008"
SHOWN = {
    "gspure": "gspure_equal@1dB",
    "random_pruning": "random_equal@1dB",
    "feature_scaling": "feature_scaling",
    "gaussian_noise": "noise_equal@1dB",
    "gof": "gof_equal@1dB",
    "plain_weight": "plain_weight",
    "prune_repair": "prune_repair",
    "reestimate": "reestimate",
}
"""The variant of each attack in the pictures, from left to right after the unattacked model."""

SHEETS = RESULTS.parent / "pictures"
TILE = (192, 144)  # pixels

PAGE = """\
---
hide: [toc]
---

# Leaderboard

The damage to the scene, in dB of PSNR, at which a message is lost: after the attack, it is above its controls in no
scene. A cell has the least such damage over all strengths of the attack that were tried; `>` means that the message
survives all of them, up to this damage. In small print: how far the message is above its control level, in dB,
after the attack at 1 dB of damage. The message is extracted as published, by an *adaptive* owner, or by an *oracle*
([schemes](schemes.md)). Click on a title to sort, and on a number to see [pictures](#pictures).
[Tables](tables/README.md) lists the commands; the models are small.

{tables}

## Pictures

One view of one of the six pairs: the scene, and below it the message as published, after each attack. With `1 dB`, the
strength of the attack was searched for that damage.

{pictures}

## Add a scheme

1. Register the scheme as a [plug-in](extending.md), or your decoder as a [detector](configuration.md#detectors).
2. Copy `config/six_pairs.yaml` to `config/NAME.yaml`, and list your scheme under `schemes:`.
3. Run `gspure audit config/NAME.yaml`.
4. Copy `results/tables/survival.csv` to `docs/results/NAME/survival.csv`.
5. Add a line to `docs/tables/README.md`: command, setting, CPU time.
6. `make docs`, look at this page, and open a pull request.
"""


def leaderboard_page() -> str:
    """Return the page as Markdown with tables in HTML."""
    runs = {path.parent.name: read_table(path, Survival) for path in sorted(RESULTS.glob("*/survival.csv"))}
    largest_first = sorted(runs.keys() - EXCLUDED, key=lambda name: -len(runs[name]))
    tables = (f"## {name}\n\n{table(runs[name], linked=name == PICTURED)}" for name in largest_first)
    return PAGE.format(tables="\n\n".join(tables), pictures="\n\n".join(map(sheet, sheets())))


def sheets() -> list[str]:
    """Return the schemes that have pictures."""
    return sorted(file.stem.removeprefix("leaderboard-") for file in SHEETS.glob("leaderboard-*.jpg"))


def sheet(scheme: str) -> str:
    """Return the pictures of a scheme, each with an anchor for its cells."""
    figures = ""
    for i, (attack, variant) in enumerate({UNATTACKED: UNATTACKED, **SHOWN}.items()):
        caption = display_name(attack) if variant == attack else f"{display_name(attack)}, 1 dB"
        figures += (
            f'<figure id="{scheme}-{attack}"><i style="background-image: url(pictures/leaderboard-{scheme}.jpg); '
            f'--at: {i}"></i><figcaption>{caption}</figcaption></figure>'
        )
    return f'### {display_name(scheme)}\n\n<div class="sheet">{figures}</div>'


def draw_sheets(results: Path) -> None:
    """Write the pictures of every scheme as one JPEG: a column for each attack."""
    from PIL import Image

    for folder in (file.parent for file in results.glob(f"*/{MODEL}/{UNATTACKED}")):
        row = Image.new("RGB", (TILE[0] * (len(SHOWN) + 1), 2 * TILE[1]))
        for i, variant in enumerate([UNATTACKED, *SHOWN.values()]):
            for j, target in enumerate(("scene", "message")):
                tile = Image.open(folder / variant / "renders" / target / f"{VIEW}.png").convert("RGB")
                row.paste(tile.resize(TILE, Image.Resampling.LANCZOS), (i * TILE[0], j * TILE[1]))
        row.save(SHEETS / f"leaderboard-{folder.parent.name}.jpg", quality=85)


def table(rows: Iterable[Survival], *, linked: bool = False) -> str:
    """Return the table of one run: a row for each condition and owner whose message is present before attacks."""
    present = [row for row in rows if row.present]
    owners = grouped(present, lambda row: (row.condition.title, extraction_name(row.extraction)))
    attacked = [row for owner_rows in owners.values() for row in owner_rows if row.variant != UNATTACKED]
    attacks = dict.fromkeys(base(row) for row in attacked)
    titles = ["scheme", "extraction", "least", *map(display_name, attacks)]
    head = "".join(f"<th>{escape(title)}</th>" for title in titles)
    body = ""
    for (condition, extraction), owner_rows in owners.items():
        body += f"<tr>{''.join(cells(condition, extraction, owner_rows, attacks, linked=linked))}</tr>"
    return f'<table class="leaderboard"><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>'


def base(row: Survival) -> str:
    """Return the attack of a row, without the damage that was searched for."""
    return EQUAL.get(row.entry, row.entry)


def cells(
    condition: str, extraction: str, rows: list[Survival], attacks: Iterable[str], *, linked: bool
) -> Iterator[str]:
    """Yield the cells of one owner: names, the least damage of all attacks, and that of each."""
    yield f"<td>{escape(condition)}</td><td>{escape(extraction)}</td>"
    yield cell([row for row in rows if row.variant != UNATTACKED], margins=False)
    scheme = rows[0].condition.scheme
    for attack in attacks:
        has_picture = linked and scheme in sheets() and attack in SHOWN
        anchor = f"{scheme}-{attack}" if has_picture else ""
        yield cell([row for row in rows if base(row) == attack], anchor=anchor)


def cell(rows: list[Survival], *, margins: bool = True, anchor: str = "") -> str:
    """Return the cell of one attack at all its strengths: colour, least damage with a link to its pictures, margins.

    A margin is the message above its control level after the attack at 1 dB of damage.
    """
    damages = _damages(rows)
    if not damages:
        return '<td data-sort="-1"></td>'
    lost = min((damage for row, damage in damages.items() if not row.survived), default=inf)
    tried = max(damages.values())
    text = decimal(lost, 1) if lost < inf else f"&gt; {decimal(tried, 1)}"
    if anchor:
        text = f'<a href="#{anchor}">{text}</a>'
    if margins:
        at_1_db = [row.above_floor.mean for row in rows if row.above_floor and is_at_1_db(row)]
        text += "".join(f"<small>{f'{margin:+.1f}'.replace('-', '−')}</small>" for margin in at_1_db)
    band = f"band{sum(lost > damage for damage in BANDS)}" if lost < inf or tried > BANDS[-1] - 0.1 else ""
    return f'<td class="{band}" data-sort="{min(lost, 1e3):.3f}">{text}</td>'


def _damages(rows: list[Survival]) -> dict[Survival, float]:
    """Return the damage of each row in dB, if it is known."""
    damages = {}
    for row in rows:
        damage = row.scene_drop or row.damage
        if damage:
            damages[row] = damage.mean
    return damages


def is_at_1_db(row: Survival) -> bool:
    """Return whether the strength was searched for 1 dB of damage."""
    return row.wanted == 1.0


if __name__ == "__main__":
    draw_sheets(Path(sys.argv[1]))
