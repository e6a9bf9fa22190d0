"""Other inconsistencies of the paper's tables, each as a sentence."""

from collections.abc import Callable, Iterator, Sequence
from itertools import combinations
from typing import Final

from gspure.evaluation.names import GSPURE, UNATTACKED, display_name
from gspure.evaluation.outcomes import MESSAGE
from gspure.evaluation.paper.cells import ATTACKS, SCHEMES, TARGETS, Cell
from gspure.evaluation.paper.quantities import by_scene
from gspure.progress import decimal


def same_columns(cells: Sequence[Cell]) -> Iterator[str]:
    """Yield pairs of attacks with the same PSNR in every scene: one of them was probably not measured."""
    for scheme, target, pair, scenes in _coincidences(cells):
        if len(scenes) == len(by_scene(cells, scheme, pair[0], target)):
            yield f"{_where(scheme)}: {_both(pair)} print the same {target} PSNR in all {len(scenes)} scenes"


def same_cells(cells: Sequence[Cell]) -> Iterator[str]:
    """Yield pairs of attacks with the same PSNR in some scenes: chance, or a cell in the wrong row."""
    for scheme, target, pair, scenes in _coincidences(cells):
        psnr = by_scene(cells, scheme, pair[0], target)
        if len(scenes) < len(psnr):
            values = ", ".join(f"{scene} {decimal(psnr[scene])}" for scene in scenes)
            yield f"{_where(scheme)}: {_both(pair)} print the same {target} PSNR: {values}"


def raised_messages(cells: Sequence[Cell]) -> Iterator[str]:
    """Yield attacks that improve the message in every scene: they did not change what the extraction reads."""
    for scheme in SCHEMES:
        for attack in ATTACKS:
            before, after = by_scene(cells, scheme, UNATTACKED, MESSAGE), by_scene(cells, scheme, attack, MESSAGE)
            gains = [after[scene] - before[scene] for scene in before]
            if min(gains) > 0:
                text = f"{display_name(attack)} raises the message's PSNR in all {len(gains)} scenes"
                yield f"{_where(scheme)}: {text}, by {decimal(min(gains))} to {decimal(max(gains))} dB"


def largest_drops(cells: Sequence[Cell]) -> Iterator[str]:
    """Yield the largest drop in a single scene; the "up to" of the abstract is a mean over scenes."""
    for scheme in SCHEMES:
        for target in TARGETS:
            after = by_scene(cells, scheme, GSPURE, target)
            drops = {scene: psnr - after[scene] for scene, psnr in by_scene(cells, scheme, UNATTACKED, target).items()}
            scene = max(drops, key=drops.__getitem__)
            text = f"{display_name(GSPURE)} lowers the {target}'s PSNR by up to {decimal(drops[scene])} dB ({scene})"
            yield f"{_where(scheme)}: {text}"


def wrong_bold(cells: Sequence[Cell]) -> Iterator[str]:
    """Yield bold cells ("the best performance") that are not the best of their column."""
    for column in _columns(cells):
        best = min(column, key=_rank)
        for cell in column:
            if cell.bold and _rank(cell) > _rank(best):
                where = f"Table {cell.table}, {cell.row}, {cell.column}"
                yield f"{where}: {decimal(cell.value)} is bold, {best.row} has {decimal(best.value)}"


def missing_bold(cells: Sequence[Cell]) -> Iterator[str]:
    """Yield columns without a bold cell, although the captions say that the best value is bold."""
    plain: dict[str, list[str]] = {}
    for column in _columns(cells):
        if not any(cell.bold for cell in column):
            plain.setdefault(f"Table {column[0].table}, {display_name(column[0].scheme)}", []).append(column[0].column)
    for where, names in plain.items():
        yield f"{where}: the best value is not bold in {len(names)} columns: {', '.join(names)}"


INCONSISTENCIES: Final[tuple[Callable[[Sequence[Cell]], Iterator[str]], ...]] = (
    same_columns,
    same_cells,
    raised_messages,
    largest_drops,
    wrong_bold,
    missing_bold,
)


def find_inconsistencies(cells: Sequence[Cell]) -> list[str]:
    """Return the sentences of all `INCONSISTENCIES`."""
    return [sentence for check in INCONSISTENCIES for sentence in check(cells)]


def _coincidences(cells: Sequence[Cell]) -> Iterator[tuple[str, str, tuple[str, str], list[str]]]:
    """Yield scheme, target and two variants with the scenes in which both have the same PSNR."""
    for scheme in SCHEMES:
        for target in TARGETS:
            for pair in combinations((UNATTACKED, *ATTACKS), 2):
                first, second = (by_scene(cells, scheme, variant, target) for variant in pair)
                if scenes := [scene for scene in first if first[scene] == second[scene]]:
                    yield scheme, target, pair, scenes


def _where(scheme: str) -> str:
    return f"Table 1, {display_name(scheme)}"


def _both(pair: tuple[str, str]) -> str:
    return " and ".join(map(display_name, pair))


def _columns(cells: Sequence[Cell]) -> list[list[Cell]]:
    """Return the cells of attacks by column and scheme: those that bold type compares."""
    columns: dict[tuple[int, str, str], list[Cell]] = {}
    for cell in cells:
        if cell.variant != UNATTACKED:
            columns.setdefault((cell.table, cell.scheme, cell.column), []).append(cell)
    return list(columns.values())


def _rank(cell: Cell) -> float:
    """Return a number that is lower for better cells: high scenes and Scores, low messages."""
    return cell.value if cell.target == MESSAGE else -cell.value
