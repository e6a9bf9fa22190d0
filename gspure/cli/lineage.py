"""Whether the inputs of a command belong together, as far as their records tell."""

from __future__ import annotations

from collections.abc import Iterable
from itertools import combinations, product
from pathlib import Path
from typing import Final

from gspure.cli.parser import Arguments, Output, Unrelated, paths_of
from gspure.cost import SUFFIX

_CONTROL: Final = "--control accepts the key of another model, a negative control"


def require_related(args: Arguments) -> None:
    """Refuse inputs that are not of one model, embedding or pair, or not made from each other, by their records.

    Several files of one option may be of different models: they are compared with single inputs only. With
    ``--control`` or ``--wrong-key``, the model may be another than that of the key. Files in the folder of a model, or
    of a variant, of ``--table`` are compared with what the table measures there. `Unrelated` inputs are not compared.
    """
    from gspure.artifacts import known_digest, require_agreement, settings_of

    model = getattr(args, "model", None)
    is_control = getattr(args, "control", False) or getattr(args, "wrong_key", None) is not None
    named = vars(args) | _files_of_records(args)
    values = [value for name, value in named.items() if not (is_control and name in {"model", "images"})]
    single = sorted(_inputs(value for value in values if isinstance(value, Path)), key=lambda path: path != model)
    several = _inputs(value for value in values if not isinstance(value, Path))
    facts = {path: _facts(path) for path in (*single, *several)}
    if model in facts:
        from gspure.model import model_file

        facts[model] = _facts(file := model_file(model))
        if any("model" in known for path, known in facts.items() if path != model):  # else the model is not read
            from gspure.schemes.registry import geometry_of

            facts[model] |= {"model": geometry_of(file)}
    if (table := getattr(args, "table", None)) in facts:
        from gspure.evaluation.origins import model_facts, tabulated_facts

        facts[table] |= {"table": known_digest(table)}
        tabulated = settings_of(table)
        for path in several:
            require_agreement(table, path, tabulated_facts(tabulated, path), model_facts(path))
    hint = _CONTROL if "control" in args and not is_control else ""
    for first, second in (*combinations(single, 2), *product(single, several)):
        require_agreement(first, second, facts[first], facts[second], hint)


def _files_of_records(args: Arguments) -> dict[str, list[Path]]:
    """Return the artifacts of ``--records``, and the costs in ``--benchmarks`` of the attacks in ``--table``."""
    from gspure.artifacts import settings_of

    records, benchmarks = getattr(args, "records", []), getattr(args, "benchmarks", None)
    costs = sorted(benchmarks.rglob(f"attack{SUFFIX}")) if benchmarks else []
    attacks = settings_of(args.table).get("attacks", {}) if costs else {}
    costs = [cost for cost in costs if "/".join(cost.parent.resolve().parts[-3:]) in attacks]  # no others are read
    return {"records": [path.with_suffix("") for path in records], "benchmarks": costs}


def _inputs(values: Iterable[object]) -> list[Path]:
    return [path for path in paths_of(values) if not isinstance(path, Output | Unrelated)]


def _facts(path: Path) -> dict[str, str]:
    """Return what records say about the origin of a file, of a folder, or of images."""
    from gspure.artifacts import facts_of
    from gspure.images import photographs_of

    return facts_of(path) | (photographs_of(path) if path.is_dir() else {})
