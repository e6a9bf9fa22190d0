"""The kinds of ``gspure figures`` with images side by side and their PSNR against a reference."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING, Any

from gspure.cli.options import add_sweeps, read_sweeps, require_variants
from gspure.cli.parser import Arguments, Parser
from gspure.errors import InputError
from gspure.evaluation.names import display_name
from gspure.settings import VIEWS

if TYPE_CHECKING:
    from gspure.evaluation.outcomes import Outcome
    from gspure.figures.lineup import Column


Drawn = tuple[dict[Path, str], dict[str, Path], dict[str, Any]]  # captions by figure, all inputs, their settings


def _add_panels(parser: Parser) -> None:
    meaning = "a column and its folder of VIEW.png, the reference first"
    parser.pairs("--column", "TITLE=DIR", meaning, Path, required=True)
    parser.number("--rows", "N", "how many views to show", VIEWS, 3)
    parser.flag("--difference", "add the difference between the last column and the first")
    parser.writes("--out", "PNG|SVG|PDF", "the figure")
    parser.set_defaults(draw=_draw_panels)


def _add_attacks(parser: Parser) -> None:
    parser.reads("--table", "CSV", "from `gspure table`")
    parser.text("--name", "SCHEME/SCENE", "the model whose variants to show", required=True)
    meaning = "a variant and its folder of TARGET/VIEW.png, the reference first"
    parser.pairs("--column", "TITLE=DIR", meaning, Path, required=True)
    add_sweeps(parser)
    parser.writes("--out", "PNG|SVG|PDF", "the figure")
    parser.set_defaults(draw=_draw_attacks)


def _draw_panels(args: Arguments) -> Drawn:
    import numpy as np

    from gspure.figures.panels import GAIN, write_panels
    from gspure.images import background_of, read_image

    if len(folders := args.column) == 1:
        raise InputError("figures panels", "--column", expected="a reference and another column", found="one")
    views = _common_views(folders.values())
    chosen = [views[i] for i in np.unique(np.linspace(0, len(views) - 1, args.rows).round().astype(int))]
    titles, background = list(folders), background_of(*folders.values())
    images = {
        title: {view: read_image(folder / f"{view}.png", background=background) for view in chosen}
        for title, folder in folders.items()
    }
    write_panels(args.out, images, chosen, difference=args.difference)
    caption = f"{len(chosen)} of {len(views)} views, with their PSNR against {display_name(titles[0])}."
    if args.difference:
        first, last = display_name(titles[0]), display_name(titles[-1])
        caption += f" Last column: {GAIN} times the absolute difference between {last} and {first}."
    files = {f"{title} {view}": folders[title] / f"{view}.png" for title in titles for view in chosen}
    return {args.out: caption}, files, {}


def _draw_attacks(args: Arguments) -> Drawn:
    from gspure.evaluation.names import GSPURE, UNATTACKED
    from gspure.evaluation.outcomes import MESSAGE, SCENE, ordered
    from gspure.evaluation.results import read_results
    from gspure.figures.lineup import chosen, write_lineup
    from gspure.images import background_of, require_comparable

    folders, results = args.column, read_results(args.table)
    of_model = [o for o in results if f"{o.scheme}/{o.folder}" == args.name]
    reference, *others = folders
    require_variants(args.table, others, (o.variant for o in of_model), f"a variant of {args.name}")
    outcomes = [o for o in of_model if o.variant in folders]
    targets = ordered({target for outcome in outcomes for target in outcome.targets})
    if not targets or UNATTACKED not in folders:
        raise InputError(
            args.table, "variant", expected=f"{UNATTACKED} of {args.name}, among the columns", found="none"
        )
    compared = MESSAGE if MESSAGE in targets else SCENE
    measured = {outcome.variant for outcome in outcomes if compared in outcome.targets}
    attacked = [name for name in (GSPURE, *others) if name in measured] if reference == UNATTACKED else []
    changed = attacked[0] if attacked else UNATTACKED
    view, count = _typical_view([folders[reference], folders[changed]], compared)
    views = dict.fromkeys(targets, view)
    if SCENE in targets and not (_target_folder(folders[reference], SCENE) / f"{view}.png").is_file():
        # the message has views of its own
        views[SCENE], _ = _typical_view([folders[reference], folders[UNATTACKED]], SCENE)

    shown = chosen(outcomes, read_sweeps(args, results))
    backgrounds = {target: background_of(_target_folder(folders[UNATTACKED], target)) for target in targets}
    columns: list[Column] = []
    files: dict[str, Path] = {}
    for title, outcome in [(reference, None), *((o.variant, o) for o in shown if o.variant != reference)]:
        rendered = targets if outcome is None else ordered(outcome.targets)
        images = {target: _target_folder(folders[title], target) / f"{views[target]}.png" for target in rendered}
        columns.append(_variant(title, images, outcome, backgrounds))
        files |= {f"{title} {target}": path for target, path in images.items()}
        _require_measured(args, "" if outcome is None else title, [path.parent for path in images.values()])
        for target, path in images.items():
            require_comparable(_target_folder(folders[reference], target), path.parent, [views[target]])
    write_lineup(args.out, targets, columns)
    of = f"after {display_name(changed)}" if changed != UNATTACKED else "before attacks"
    caption = f"View {view} of {count} after every attack: the one with the median {compared} PSNR {of}."
    if any(column.unreached for column in columns):
        caption += " † The attack did not change the carrier of this extraction."
    if len(shown) < sum(not o.is_control for o in outcomes):
        strength = "with the highest Score" if any(isfinite(o.score) for o in outcomes) else "that is listed first"
        caption += f" Attacks with several strengths are shown at the one {strength}, GSPure at its default."
    return {args.out: caption}, {"table": args.table, **files}, {}


def _require_measured(args: Arguments, variant: str, folders: Iterable[Path]) -> None:
    """Refuse images that were not measured for a variant of the table, or for any variant, as far as records tell."""
    from gspure.artifacts import RENDERED, file_digest, settings_of

    measured = settings_of(args.table).get("images", {})
    of_variant = f"{args.name}/{variant}" if variant else args.name
    known = {d for name, digests in measured.items() if f"{name}/".startswith(f"{of_variant}/") for d in digests}
    for folder in folders:
        if known and (record := folder / RENDERED).is_file() and file_digest(record) not in known:
            expected = f"those that the table measures for {of_variant}"
            raise InputError(folder, "images", expected=expected, found="others")


def _variant(
    title: str, files: dict[str, Path], outcome: Outcome | None, backgrounds: Mapping[str, Sequence[float]]
) -> Column:
    from gspure.evaluation.matched import reached_damage, reached_name
    from gspure.evaluation.names import UNATTACKED
    from gspure.figures.lineup import Column
    from gspure.images import read_image

    images = {target: read_image(path, background=backgrounds[target]) for target, path in files.items()}
    if outcome is None or outcome.variant == UNATTACKED:
        return Column(title, images)
    unreached = frozenset(target for target, reached in outcome.reached.items() if not reached)
    return Column(reached_name(title, reached_damage(outcome)), images, unreached, outcome.failure)


def _typical_view(folders: Sequence[Path], target: str) -> tuple[str, int]:
    """Return the view of a target with the median PSNR of the second folder against the first, and of how many."""
    from gspure.figures.lineup import typical
    from gspure.images import background_of, read_image

    of_target = [_target_folder(folder, target) for folder in folders]
    views, background = _common_views(of_target), background_of(*of_target)
    images = [
        {view: read_image(folder / f"{view}.png", background=background) for view in views} for folder in of_target
    ]
    return typical(*images), len(views)


def _target_folder(folder: Path, target: str) -> Path:
    """Return the folder of a target's images; the truth of all extractions is that of the message."""
    for path in (folder / target, folder / target.partition("_")[0]):
        if path.is_dir():
            return path
    raise InputError(folder, "folder", expected=f"images in {target}/", found="no such folder")


def _common_views(folders: Iterable[Path]) -> list[str]:
    """Return the sorted names of the views in all folders, without those off the camera path."""
    from gspure.cameras.off_path import PREFIX
    from gspure.images import require_comparable

    folders = list(folders)
    names = set.intersection(*({path.stem for path in folder.glob("*.png")} for folder in folders))
    views = sorted(name for name in names if not name.startswith(PREFIX))
    if not views:
        raise InputError(folders[0], "*.png", expected="a view of all columns", found="none")
    for folder in folders[1:]:
        require_comparable(folders[0], folder, views)
    return views


KINDS = {
    "panels": ("the same views in several renderings, with their PSNR", _add_panels),
    "attacks": ("one view of scene and message after every attack, with its PSNR", _add_attacks),
}
