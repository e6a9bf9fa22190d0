"""The kinds of ``gspure figures`` that lay images beside each other, with their PSNR against a reference."""

from __future__ import annotations

import argparse
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING

from gspure.cli.options import add_sweeps
from gspure.errors import InputError

if TYPE_CHECKING:
    from gspure.evaluation.outcomes import Outcome
    from gspure.figures.lineup import Column


def add_panels(parser: argparse.ArgumentParser) -> None:
    """Add the options of ``gspure figures panels``."""
    _add_columns(parser, "a column and its folder of VIEW.png; give the reference first; may be repeated")
    parser.add_argument(
        "--rows", type=int, default=3, metavar="N", help="how many views to show (default: %(default)s)"
    )
    parser.add_argument(
        "--difference", action="store_true", help="add the difference between the last column and the first"
    )
    parser.add_argument("--out", type=Path, required=True, metavar="PNG", help="the figure")
    parser.set_defaults(draw=_draw_panels)


def add_attacks(parser: argparse.ArgumentParser) -> None:
    """Add the options of ``gspure figures attacks``."""
    parser.add_argument("--table", type=Path, required=True, metavar="CSV", help="from `gspure table`")
    parser.add_argument("--asset", required=True, metavar="SCHEME/SCENE", help="the model whose variants to show")
    _add_columns(
        parser,
        "a variant and its folder of TARGET/VIEW.png; give the truth first, or else what all are compared with; may be "
        "repeated",
    )
    add_sweeps(parser)
    parser.add_argument("--out", type=Path, required=True, metavar="PNG", help="the figure")
    parser.set_defaults(draw=_draw_attacks)


def _add_columns(parser: argparse.ArgumentParser, meaning: str) -> None:
    parser.add_argument("--column", type=_column, action="append", required=True, metavar="TITLE=DIR", help=meaning)


def _column(text: str) -> tuple[str, Path]:
    title, found, folder = text.rpartition("=")
    if not (title and found and folder):
        raise argparse.ArgumentTypeError(f"expected TITLE=DIR, found {text!r}")
    return title, Path(folder)


def _draw_panels(args: argparse.Namespace) -> None:
    import numpy as np

    from gspure.evaluation.names import display_name
    from gspure.figures.panels import GAIN, write_panels
    from gspure.images import read_image

    folders = dict(args.column)
    views = _common_views(folders.values())
    chosen = [views[i] for i in np.unique(np.linspace(0, len(views) - 1, args.rows).round().astype(int))]
    images = {title: {view: read_image(folder / f"{view}.png") for view in chosen} for title, folder in folders.items()}
    write_panels(args.out, images, chosen, difference=args.difference)
    titles = list(folders)
    caption = f"{len(chosen)} of {len(views)} views, with their PSNR against {display_name(titles[0])}."
    if args.difference:
        first, last = display_name(titles[0]), display_name(titles[-1])
        caption += f" Last column: {GAIN} times the absolute difference between {last} and {first}."
    _note(args.out, caption, {f"{title} {view}": folders[title] / f"{view}.png" for title in titles for view in chosen})


def _draw_attacks(args: argparse.Namespace) -> None:
    from gspure.evaluation.outcomes import MESSAGE, SCENE, UNATTACKED, ordered
    from gspure.evaluation.results import read_results
    from gspure.figures.lineup import chosen, typical, write_lineup
    from gspure.images import read_image

    folders = dict(args.column)
    outcomes = [o for o in read_results(args.table) if f"{o.scheme}/{o.asset}" == args.asset and o.variant in folders]
    targets = ordered({target for outcome in outcomes for target in outcome.targets})
    if not targets or UNATTACKED not in folders:
        raise InputError(
            args.table, "variant", expected=f"{UNATTACKED} of {args.asset}, among the columns", found="none"
        )
    judged = MESSAGE if MESSAGE in targets else SCENE
    reference = next(iter(folders))
    places = [_place(folders[name], judged) for name in (reference, UNATTACKED)]
    views = _common_views(places)
    view = typical(*({name: read_image(place / f"{name}.png") for name in views} for place in places))

    shown = chosen(outcomes, dict(args.sweep))
    columns: list[Column] = []
    files: dict[str, Path] = {}
    for title, outcome in [(reference, None), *((o.variant, o) for o in shown if o.variant != reference)]:
        found = targets if outcome is None else ordered(outcome.targets)
        own = {target: _place(folders[title], target) / f"{view}.png" for target in found}
        columns.append(_variant(title, own, outcome))
        files |= {f"{title} {target}": path for target, path in own.items()}
    write_lineup(args.out, targets, columns)
    caption = f"View {view} after every attack: of {len(views)}, the one whose {judged} has the median PSNR unattacked."
    if any(column.unreached for column in columns):
        caption += " † The attack changed nothing that this extraction reads."
    if len(shown) < sum(not o.is_control for o in outcomes):
        caption += " Attacks with several strengths are shown at the highest Score, GSPure at its default."
    _note(args.out, caption, {"table": args.table, **files})


def _variant(title: str, files: dict[str, Path], outcome: Outcome | None) -> Column:
    from gspure.evaluation.outcomes import UNATTACKED
    from gspure.figures.lineup import Column
    from gspure.images import read_image

    images = {target: read_image(path) for target, path in files.items()}
    if outcome is None or outcome.variant == UNATTACKED:
        return Column(title, images)
    unreached = frozenset(target for target, reached in outcome.reached.items() if not reached)
    return Column(title, images, unreached, outcome.failure)


def _place(folder: Path, target: str) -> Path:
    """Return where the images of a target are; of another extraction's truth, they are the message's."""
    return next((place for place in (folder / target, folder / target.partition("_")[0]) if place.is_dir()), folder)


def _common_views(folders: Iterable[Path]) -> list[str]:
    """Return the names of the views on the path of the cameras that are in all folders, sorted."""
    from gspure.cameras.off_path import PREFIX

    folders = list(folders)
    names = set.intersection(*({path.stem for path in folder.glob("*.png")} for folder in folders))
    views = sorted(name for name in names if not name.startswith(PREFIX))
    if not views:
        raise InputError(folders[0], "*.png", expected="a view that all columns have", found="none")
    return views


def _note(path: Path, caption: str, inputs: dict[str, Path]) -> None:
    """Write beside a figure what it shows and what it was made of, and say where it is."""
    from gspure.artifacts import write_provenance

    write_provenance(path, inputs=inputs, settings={"caption": caption})
    print(f"{path}: {caption}")
