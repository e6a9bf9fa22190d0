"""Mutation testing: one small change to the source at a time, which some test must notice.

It covers the numerical core, and plans, jobs and outcomes.

A process has numpy, pytest and the like imported; for every mutant it forks, and the child imports the changed module
in place of the file and runs the tests of that module up to the first failure.
"""

import argparse
import ast
import copy
import importlib
import math
import os
import random
import resource
import signal
import sys
from collections.abc import Iterator
from importlib.abc import Loader, MetaPathFinder
from importlib.util import spec_from_loader
from pathlib import Path
from typing import NamedTuple

from gspure.progress import say

ROOT = Path(__file__).parents[1]
_FRAME = (
    "test_renderer.py::test_any_image_size_agrees",
    "test_renderer.py::test_any_number_of_channels_agrees_with_a_background_for_each",
    "test_renderer.py::test_any_number_of_gaussians_agrees",
    "test_renderer.py::test_bands_give_the_same_bits",
    "test_renderer.py::test_nothing_in_sight_leaves_the_background",
    "test_renderer.py::test_earlier_views_leave_no_trace",
)
_AWKWARD = "test_renderer.py::test_awkward_models_agree_with_the_reference"
_STAGED = "test_device.py::test_a_work_group_stages_as_many_splats_as_three_quarters_of_local_memory_hold"
CORE = {
    **{f"gspure.method.{name}": (f"test_{name}.py",) for name in ("weights", "features", "pruning")},
    **{f"gspure.metrics.{name}": ("test_evidence.py",) for name in ("bit_evidence", "proof", "legibility")},
    "gspure.metrics.image_metrics": ("test_metrics.py",),
    "gspure.schemes.splats_in_splats.bits": ("test_hidden_scene.py",),
    "gspure.opencl.ordering": ("test_kernels.py", *_FRAME),
    "gspure.opencl.projection": ("test_kernels.py", _AWKWARD, *_FRAME),
    "gspure.opencl.binning": ("test_kernels.py", *_FRAME),
    "gspure.opencl.blending": (_STAGED, *_FRAME),
    "gspure.opencl.storage": ("test_kernels.py", "test_renderer.py::test_the_storage_order_does_not_matter", *_FRAME),
    "gspure.renderer": ("test_renderer.py", "test_gradients.py", "test_contributions.py", "test_opacity_field.py"),
}

_RESULTS = ("test_radius.py", "test_answer.py")
_EVALUATED = ("attacking", "comparing", "evaluate", "searching", "showing")
_PLANS = ("test_plan.py", "test_configuration.py")
JOBS = {
    "gspure.codec": ("test_codec.py", "test_configuration.py"),
    "gspure.evaluation.collecting": ("test_outcomes.py",),
    "gspure.evaluation.forging": ("test_forging.py",),
    "gspure.evaluation.identity": ("test_outcomes.py", "test_plan.py"),
    "gspure.evaluation.evidence": ("test_radius.py", "test_evaluate.py"),
    "gspure.evaluation.outcomes": ("test_outcomes.py", *_RESULTS),
    "gspure.evaluation.plan": (*_PLANS, "test_codec.py", "test_evaluate.py"),
    "gspure.evaluation.attack_record": ("test_evaluate.py", "test_outcomes.py"),
    "gspure.workflow.auditing": (
        "test_audit_command.py",
        "test_exit_statuses.py",
        "test_workflow.py::test_an_audit_in_python_returns_results_and_is_silent",
    ),
    "gspure.workflow.request": ("test_audit_command.py",),
    "gspure.workflow.config": ("test_codec.py", *_PLANS),
    "gspure.workflow.config_reading": ("test_configuration.py",),
    "gspure.workflow.console": ("test_console.py",),
    "gspure.workflow.forecast": ("test_running.py",),
    "gspure.workflow.inputs": (*_PLANS, "test_cameras_places.py"),
    "gspure.workflow.matrix": ("test_configuration.py",),
    "gspure.workflow.schema": ("test_codec.py",),
    "gspure.workflow.sources": ("test_sources.py",),
    "gspure.workflow.step": ("test_step.py",),
    **{f"gspure.evaluation.{name}": ("test_evaluate.py",) for name in _EVALUATED},
    **{f"gspure.evaluation.{name}": ("test_step.py",) for name in ("deciding", "revealing")},
    **{f"gspure.evaluation.{name}": _RESULTS for name in ("judging", "radius", "results")},
    **{f"gspure.workflow.{name}": _PLANS for name in ("assets", "decisions", "jobs", "pairs", "planning", "variants")},
}
MODULES = CORE | JOBS
"""Modules, and the tests that must notice a change, those first that fail soonest."""

_PAIRS = [(ast.Add, ast.Sub), (ast.Mult, ast.Div), (ast.BitAnd, ast.BitOr), (ast.LShift, ast.RShift), (ast.And, ast.Or)]
_PAIRS += [(ast.Lt, ast.LtE), (ast.Gt, ast.GtE), (ast.Eq, ast.NotEq), (ast.Is, ast.IsNot), (ast.In, ast.NotIn)]
_OPERATORS = {ast.FloorDiv: ast.Mult, ast.Mod: ast.Mult, ast.Pow: ast.Mult, ast.BitXor: ast.BitAnd}
_OPERATORS |= {one: other for pair in _PAIRS for one, other in (pair, pair[::-1])}
_NAMES = {"min": "max", "max": "min", "minimum": "maximum", "maximum": "minimum", "any": "all", "all": "any"}
_NAMES |= {"floor": "ceil", "ceil": "floor", "zeros": "ones", "ones": "zeros"}
_NAMES |= {"argmin": "argmax", "sum": "max", "mean": "max"}
LEAST = 0.94  # share of mutants that the tests must notice

IGNORED = ("-W", "ignore::pytest.PytestAssertRewriteWarning")  # some packages are imported before pytest is ready
TIMES = 6
"""A mutant under which the tests take so many times the CPU time as without it is noticed too: it does not end."""

WALL_SECONDS = 1200
"""A mutant under which the tests wait for so long is noticed too; other processes may slow them down."""


class Mutant(NamedTuple):
    line: int
    change: str
    tree: ast.Module


def mutants(source: str) -> Iterator[Mutant]:
    """Yield every change, one at a time; texts, annotations, errors and sizes of buffers stay."""
    tree = ast.parse(source)
    places = [node for node in _walk(tree) if list(_changes(node))]
    for number, node in enumerate(places):
        for which, (what, _) in enumerate(_changes(node)):
            changed = copy.deepcopy(tree)
            twin = [each for each in _walk(changed) if list(_changes(each))][number]
            list(_changes(twin))[which][1]()
            yield Mutant(node.lineno, what, ast.fix_missing_locations(changed))


def _walk(node: ast.AST) -> Iterator[ast.AST]:
    for name, value in ast.iter_fields(node):
        if name in {"annotation", "returns", "decorator_list"}:
            continue
        for child in value if isinstance(value, list) else [value]:
            if isinstance(child, ast.AST) and not _left_alone(child):
                if hasattr(child, "lineno"):
                    yield child
                yield from _walk(child)


def _left_alone(node: ast.AST) -> bool:
    """Whether changes would show in texts or scripts only, or not at all, as in sizes of device buffers."""
    match node:
        case ast.Raise() | ast.JoinedStr() | ast.Import() | ast.ImportFrom():
            return True
        case ast.If(test=ast.Compare(left=ast.Name(id="__name__"))):
            return True
        case ast.Call(func=ast.Attribute(attr="sized" | "allocate")) | ast.keyword(arg="strict"):
            return True
    return False


def _changes(node: ast.AST) -> list[tuple[str, object]]:
    """What may be changed in a node: a description, and a function that does it."""
    changes = []
    operator = type(node.ops[0]) if isinstance(node, ast.Compare) else type(getattr(node, "op", None))
    if operator in _OPERATORS:
        other = _OPERATORS[operator]
        operators = {"ops": [other(), *node.ops[1:]]} if isinstance(node, ast.Compare) else {"op": other()}
        changes.append((f"{operator.__name__} -> {other.__name__}", lambda: vars(node).update(operators)))
    if isinstance(node, ast.UnaryOp):
        changes.append((f"no {type(node.op).__name__}", lambda: _become(node, node.operand)))
    if isinstance(node, ast.Constant) and type(node.value) in {int, float, bool}:
        value = not node.value if isinstance(node.value, bool) else node.value + 1
        changes.append((f"{node.value} -> {value}", lambda: setattr(node, "value", value)))
    if isinstance(node, ast.Attribute) and node.attr in _NAMES:
        changes.append((f"{node.attr} -> {_NAMES[node.attr]}", lambda: setattr(node, "attr", _NAMES[node.attr])))
    if isinstance(node, ast.If | ast.IfExp | ast.While):
        changes.append(("negated", lambda: setattr(node, "test", ast.UnaryOp(ast.Not(), node.test))))
    if isinstance(node, ast.Expr) and isinstance(node.value, ast.Call):
        changes.append(("call removed", lambda: setattr(node, "value", ast.Constant(None))))
    return changes


def _become(node: ast.UnaryOp, operand: ast.expr) -> None:
    """Take the place of a node: its operator becomes the one that changes nothing, or a double negation."""
    if isinstance(node.op, ast.Not | ast.Invert):
        node.operand = ast.UnaryOp(node.op, operand)
    else:
        node.op = ast.UAdd()


class _Changed(MetaPathFinder, Loader):
    """Imports one module from a syntax tree."""

    def __init__(self, name: str, tree: ast.Module, file: Path) -> None:
        self.name, self.tree, self.file = name, tree, file

    def find_spec(self, name, path=None, target=None):
        return spec_from_loader(name, self, origin=str(self.file)) if name == self.name else None

    def exec_module(self, module):
        module.__file__ = str(self.file)
        exec(compile(self.tree, str(self.file), "exec"), module.__dict__)  # noqa: S102


def main() -> None:
    """Test all mutants of the modules; show the score of each, and what survived."""
    parser = argparse.ArgumentParser(prog="python setup/mutants.py", description=main.__doc__)
    parser.add_argument("--only", nargs="*", default=list(MODULES), metavar="MODULE")
    parser.add_argument("--sample", type=int, default=1000, help="at most so many of each module, drawn at random")
    args = parser.parse_args()
    for name in ("numpy", "scipy.special", "scipy.spatial.transform", "pytest", "hypothesis.extra.numpy", "pyopencl"):
        importlib.import_module(name)
    noticed = total = 0
    for name in args.only:
        count, survivors = tested(name, MODULES[name], args.sample)
        noticed, total = noticed + count - len(survivors), total + count
        say(f"{name}: {count - len(survivors)} of {count}")
        for survivor in survivors:
            say(f"    {survivor}")
    say(f"noticed {noticed} of {total} ({noticed / total:.1%})")
    sys.exit(noticed < LEAST * total)


def tested(module: str, tests: tuple[str, ...], sample: int) -> tuple[int, list[str]]:
    """Run the tests of a module on each of its mutants, or on a sample: return their number, and what survived."""
    if module in sys.modules:
        raise RuntimeError(f"{module} was imported before it was changed")
    file = ROOT / f"{module.replace('.', '/')}.py"
    source = file.read_text()
    status, seconds = _status(module, ast.parse(source), file, tests, WALL_SECONDS)
    if status:
        raise RuntimeError(f"the tests of {module} fail")
    patience = 10 + math.ceil(TIMES * seconds)
    every = list(mutants(source))
    tried = random.Random(module).sample(every, min(sample, len(every)))  # noqa: S311
    survivors = [
        f"{mutant.line}: {mutant.change}: {source.splitlines()[mutant.line - 1].strip()}"
        for mutant in sorted(tried, key=lambda mutant: mutant.line)
        if not _status(module, mutant.tree, file, tests, patience)[0]
    ]
    return len(tried), survivors


def _status(module: str, tree: ast.Module, file: Path, tests: tuple[str, ...], patience: int) -> tuple[int, float]:
    """Return 0 if the tests pass within `patience` seconds of CPU time, and the CPU time."""
    child = os.fork()
    if not child:
        resource.setrlimit(resource.RLIMIT_CPU, (patience, patience))
        signal.alarm(WALL_SECONDS)  # ends the process
        _tests_in_child(module, tree, file, tests)
    _, status, usage = os.wait4(child, 0)
    return status, usage.ru_utime + usage.ru_stime


def _tests_in_child(module: str, tree: ast.Module, file: Path, tests: tuple[str, ...]) -> None:
    import pytest

    status = 70
    try:
        quiet = os.open(os.environ.get("HOSTILE_OUTPUT", os.devnull), os.O_WRONLY | os.O_CREAT)
        os.dup2(quiet, 1)
        os.dup2(quiet, 2)
        os.chdir(ROOT)
        sys.meta_path.insert(0, _Changed(module, tree, file))
        paths = [f"tests/{name}" for name in tests]
        status = int(pytest.main(["-x", "-q", "-p", "no:cacheprovider", *IGNORED, *paths]))
    finally:
        os._exit(min(status, 100))


if __name__ == "__main__":
    main()
