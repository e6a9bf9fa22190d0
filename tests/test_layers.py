"""The arrows of the architecture: what may import what. Read from the sources, nothing is imported."""

from __future__ import annotations

import ast
import graphlib
import re
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

import gspure

PACKAGE = Path(gspure.__file__).parent
ROOT = PACKAGE.parent
SOURCES = [source for package in ("gspure", "gspure_torch") for source in sorted((ROOT / package).rglob("*.py"))]
TREES = {source: ast.parse(source.read_text(encoding="utf-8")) for source in SOURCES}

DRAWING = (ROOT / "docs" / "architecture.md").read_text().partition("```text\n")[2].partition("```")[0]
DEPTH = {
    part: depth
    for depth, layer in enumerate(DRAWING.splitlines())
    for part in re.findall(r"(?:^|(?<=  ))(\w+)/?(?=  |$)", layer)
}
"""The layer of each part, as the architecture draws them: a part imports from its own layer and from those above it."""

# Packages that only one part or module knows, and packages too slow to import before they are needed.
OWNERS = {
    "pyopencl": ("opencl",),
    "pyvista": ("figures",),
    "vtk": ("figures",),
    "vtkmodules": ("figures",),
    "matplotlib": ("figures",),
    "argparse": ("cli",),
    "plyfile": ("model",),
    "gsply": ("model/compressed.py",),
    "gaussforge": ("attacks/compression.py",),
    "hdbscan": ("method/tree.py",),
    "snakemake": (),
    "requests": ("datasets.py",),
    "torch": ("gspure_torch/pytorch.py",),
    "gspure_torch": ("gspure_torch", "cli/cuda_free.py"),
    "pickle": (),
}
HEAVY = {"gaussforge", "gsply", "zstandard", "hdbscan", "jinja2", "matplotlib", "pyvista", "requests"}
HEAVY |= {"rich", "scipy", "sklearn", "vtk", "vtkmodules"}

CREATION = re.compile(r"torch\.(?:from_numpy|tensor|as_tensor|zeros|ones)\(")
PLACING = ("gspure_torch/pytorch.py", "gspure_torch/bridge.py", "gspure_torch/cuda_free")
"""The function that places the tensors of schemes, and what takes tensors of a program on any device."""


def place_of(source: Path) -> Path:
    """Return the path of a source in gspure, or its path from the folder gspure_torch on."""
    return source.relative_to(PACKAGE if source.is_relative_to(PACKAGE) else ROOT)


def part_of(source: Path) -> str:
    """Return the part a source belongs to, gspure_torch or one of gspure; "" for gspure's own __init__ and __main__."""
    first = place_of(source).parts[0].removesuffix(".py")
    return "" if first.startswith("__") else first


def imported(tree: ast.AST) -> Iterator[str]:
    """Yield the dotted names that are imported anywhere below `tree`."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"relative import of {node.module}"
            yield from (f"{node.module}.{alias.name}" for alias in node.names)


def parts_imported(source: Path) -> set[str]:
    """Return the parts that a source imports."""
    names = [name.split(".") for name in imported(TREES[source])]
    parts = {name[1] for name in names if name[0] == "gspure" and len(name) > 1 and name[1] != "__version__"}
    return parts | {name[0] for name in names if name[0] == "gspure_torch"}


def run_at_import(tree: ast.Module) -> Iterator[ast.stmt]:
    """Yield the statements of a module's own level, without those for type checkers only."""
    for statement in tree.body:
        type_checking = isinstance(statement, ast.If) and ast.unparse(statement.test) == "TYPE_CHECKING"
        if not type_checking and not isinstance(statement, (ast.FunctionDef, ast.ClassDef)):
            yield statement


def offences(forbidden: Callable[[Path], set[str]]) -> list[str]:
    """Return "file: names" for each source for which `forbidden` returns some."""
    found = ((source, forbidden(source)) for source in TREES)
    return [f"{place_of(source)}: {sorted(names)}" for source, names in found if names]


def test_a_module_imports_only_from_its_own_layer_and_those_above() -> None:
    def from_below(source: Path) -> set[str]:
        part = part_of(source)
        if part == "":
            return set()  # the public names come from everywhere
        return {other for other in parts_imported(source) if DEPTH[other] > DEPTH[part]}

    assert offences(from_below) == []


def test_no_modules_import_each_other_in_a_circle() -> None:
    names = {".".join(source.relative_to(ROOT).with_suffix("").parts): source for source in TREES}
    modules = {name.removesuffix(".__init__"): source for name, source in names.items()}
    graph = {}
    for module, source in modules.items():
        found = {name if name in modules else name.rpartition(".")[0] for name in imported(TREES[source])}
        graph[module] = found & modules.keys() - {module, "gspure"}  # the public names come from everywhere
    graphlib.TopologicalSorter(graph).prepare()  # raises CycleError


def test_a_package_with_an_owner_is_imported_by_it_only() -> None:
    def stray(source: Path) -> set[str]:
        packages = {name.split(".")[0] for name in imported(TREES[source])} & OWNERS.keys()
        place = place_of(source)
        return {package for package in packages if not any(place.is_relative_to(owner) for owner in OWNERS[package])}

    assert offences(stray) == []


def test_heavy_packages_are_imported_where_they_are_needed() -> None:
    def early(source: Path) -> set[str]:
        return HEAVY & {name.split(".")[0] for s in run_at_import(TREES[source]) for name in imported(s)}

    assert offences(early) == []


def test_schemes_place_every_tensor_by_one_function() -> None:
    def placed(source: Path) -> set[str]:
        if any(place_of(source).is_relative_to(place) for place in PLACING):
            return set()
        return {*CREATION.findall(source.read_text(encoding="utf-8"))}

    assert offences(placed) == []


STATEMENTS = {
    "": 1509,
    "attacks": 1152,
    "cameras": 1411,
    "certificate": 268,
    "cli": 2028,
    "evaluation": 1471,
    "figures": 1044,
    "gspure_torch": 2442,
    "method": 672,
    "metrics": 880,
    "model": 1360,
    "opencl": 1545,
    "report": 789,
    "scan": 244,
    "scenes": 687,
    "schemes": 1555,
    "surface": 219,
    "training": 683,
    "viewer": 211,
    "workflow": 1512,
}
"""Statements of each folder when it was last measured."""

SLACK = 1.1  # growth beyond this is a decision, which edits that table

MOST_LINES = 60  # of a function
MOST_PARAMETERS = 8
SIGNATURES = {"purify", "embed"}  # public: their parameters are settings

PRIVATE = re.compile(
    r"workflow\._|\._build_dag|update_needrun|persistence\.|exit_gracefully|_user_kill|scheduler\.failed|"
    r"spawned_job_args_factory"
)
"""Names of Snakemake that are not its interface."""


@pytest.mark.parametrize("folder", STATEMENTS)
def test_a_folder_keeps_to_its_budget_of_statements(folder: str) -> None:
    sources = [source for source in TREES if place_of(source).parent.parts[:1] == ((folder,) if folder else ())]
    count = sum(isinstance(node, ast.stmt) for source in sources for node in ast.walk(TREES[source]))
    assert count <= SLACK * STATEMENTS[folder]


def test_a_function_fits_on_a_screen() -> None:
    functions = [node for tree in TREES.values() for node in ast.walk(tree) if isinstance(node, ast.FunctionDef)]
    assert {f.name for f in functions if (f.end_lineno or 0) - f.lineno >= MOST_LINES} <= SIGNATURES
    assert {f.name for f in functions if len(parameters(f)) > MOST_PARAMETERS} <= SIGNATURES


def parameters(function: ast.FunctionDef) -> list[str]:
    """Return the parameters of a function, or of a method without its object."""
    arguments = function.args
    names = [argument.arg for argument in [*arguments.posonlyargs, *arguments.args, *arguments.kwonlyargs]]
    return names[1:] if names[:1] in (["self"], ["cls"]) else names


def test_no_private_name_of_snakemake_is_used() -> None:
    rules = ROOT / "rules"
    texts = [*TREES, ROOT / "Snakefile", *rules.rglob("*.smk"), *rules.rglob("*.py")]
    assert [path.name for path in texts if PRIVATE.search(path.read_text(encoding="utf-8"))] == []
