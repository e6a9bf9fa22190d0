"""What else does not fit in the paper's tables: found in the cells, each as a sentence."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from itertools import combinations
from typing import Final

from gspure.evaluation.outcomes import MESSAGE, REFERENCE
from gspure.evaluation.paper.cells import ATTACKS, SCHEMES, TARGETS, Cell
from gspure.evaluation.paper.checks import OURS
from gspure.evaluation.paper.quantities import by_scene


def same_columns(cells: Sequence[Cell]) -> Iterator[str]:
    """Yield attacks that leave the same PSNR in every scene: one of them can hardly have been measured."""
    for scheme, target, a, b, scenes in _coincidences(cells):
        if len(scenes) == len(by_scene(cells, scheme, a, target)):
            yield f"Table 1, {scheme}: {a} and {b} print the same {target} PSNR in all {len(scenes)} scenes"


def same_cells(cells: Sequence[Cell]) -> Iterator[str]:
    """Yield two attacks with the same PSNR in some scenes, which may be chance or a cell in the wrong row."""
    for scheme, target, a, b, scenes in _coincidences(cells):
        if len(scenes) < len(by_scene(cells, scheme, a, target)):
            values = ", ".join(f"{scene} {by_scene(cells, scheme, a, target)[scene]:.2f}" for scene in scenes)
            yield f"Table 1, {scheme}: {a} and {b} print the same {target} PSNR: {values}"


def raised_messages(cells: Sequence[Cell]) -> Iterator[str]:
    """Yield attacks after which the message is better than before in every scene: they did not reach its carrier."""
    for scheme in SCHEMES:
        for attack in ATTACKS:
            before, after = by_scene(cells, scheme, REFERENCE, MESSAGE), by_scene(cells, scheme, attack, MESSAGE)
            gains = [after[scene] - before[scene] for scene in before]
            if min(gains) > 0:
                yield (
                    f"Table 1, {scheme}: {attack} raises the message's PSNR in all {len(gains)} scenes, "
                    f"by {min(gains):.2f} to {max(gains):.2f} dB"
                )


def largest_drops(cells: Sequence[Cell]) -> Iterator[str]:
    """Yield what "up to" would mean of single scenes; the abstract's number is a mean over scenes."""
    for scheme in SCHEMES:
        for target in TARGETS:
            after = by_scene(cells, scheme, OURS, target)
            drops = {scene: psnr - after[scene] for scene, psnr in by_scene(cells, scheme, REFERENCE, target).items()}
            scene = max(drops, key=drops.__getitem__)
            yield f"Table 1, {scheme}: {OURS} costs the {target} up to {drops[scene]:.2f} dB ({scene})"


def beaten_bold(cells: Sequence[Cell]) -> Iterator[str]:
    """Yield bold cells, "the best performance", that another one of their column beats."""
    for column in _columns(cells):
        best = min(column, key=_rank)
        for cell in column:
            if cell.bold and _rank(cell) > _rank(best):
                where = f"Table {cell.table}, {cell.row}, {cell.column}"
                yield f"{where}: {cell.value:.2f} is bold, {best.row} has {best.value:.2f}"


def without_bold(cells: Sequence[Cell]) -> Iterator[str]:
    """Yield the columns in which nothing is bold, although captions say that the best value is."""
    plain: dict[str, list[str]] = {}
    for column in _columns(cells):
        if not any(cell.bold for cell in column):
            plain.setdefault(f"Table {column[0].table}, {column[0].scheme}", []).append(column[0].column)
    for where, names in plain.items():
        yield f"{where}: the best value is not bold in {len(names)} columns: {', '.join(names)}"


ODDITIES: Final[tuple[Callable[[Sequence[Cell]], Iterator[str]], ...]] = (
    same_columns,
    same_cells,
    raised_messages,
    largest_drops,
    beaten_bold,
    without_bold,
)


def find_oddities(cells: Sequence[Cell]) -> list[str]:
    """Return all of them."""
    return [sentence for oddity in ODDITIES for sentence in oddity(cells)]


def _coincidences(cells: Sequence[Cell]) -> Iterator[tuple[str, str, str, str, list[str]]]:
    for scheme in SCHEMES:
        for target in TARGETS:
            for a, b in combinations((REFERENCE, *ATTACKS), 2):
                ours, theirs = by_scene(cells, scheme, a, target), by_scene(cells, scheme, b, target)
                if scenes := [scene for scene in ours if ours[scene] == theirs[scene]]:
                    yield scheme, target, a, b, scenes


def _columns(cells: Sequence[Cell]) -> list[list[Cell]]:
    """Return the attacks' cells that are compared with each other: of one column and one scheme."""
    columns: dict[tuple[int, str, str], list[Cell]] = {}
    for cell in cells:
        if cell.variant != REFERENCE:
            columns.setdefault((cell.table, cell.scheme, cell.column), []).append(cell)
    return list(columns.values())


def _rank(cell: Cell) -> float:
    """Return a number that is lower for better cells: scenes and Scores should be high, messages low."""
    return cell.value if cell.target == MESSAGE else -cell.value
