"""The dialects of `diff_gaussian_rasterization`: the inputs that a copy of it takes, and what it returns."""

from __future__ import annotations

import ast
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from gspure.errors import InputError, reading

PACKAGE: Final = "diff_gaussian_rasterization"

SETTINGS: Final = (
    "image_height",
    "image_width",
    "tanfovx",
    "tanfovy",
    "bg",
    "scale_modifier",
    "viewmatrix",
    "projmatrix",
    "sh_degree",
    "campos",
    "prefiltered",
    "debug",
)
_INPUTS: Final = ("means3D", "means2D", "opacities", "shs", "colors_precomp", "scales", "rotations", "cov3D_precomp")

KNOWN_SETTINGS: Final = {*SETTINGS, "antialiasing"}
KNOWN_INPUTS: Final = {*_INPUTS, "semantic_feature"}
NAMES_OF_OUTPUTS: Final = {
    "color": ("color", "image", "rendered_image"),
    "radii": ("radii",),
    "features": ("feature_map",),
    "depth": ("depth", "out_depth", "rendered_depth"),
    "inverse_depth": ("invdepth", "invdepths", "inverse_depth"),
    "alpha": ("alpha", "out_alpha", "opacity", "rendered_alpha"),
}
"""The names under which the wrappers of public programs return each output."""


@dataclass(frozen=True)
class Dialect:
    """One version of the rasterizer.

    Parameters
    ----------
    settings : tuple of str
        The fields of `GaussianRasterizationSettings`.
    inputs : tuple of str
        The arguments of `GaussianRasterizer.forward`.
    outputs : tuple of str
        What it returns, in the names of `NAMES_OF_OUTPUTS`.
    has_radii_per_axis : bool
        Whether gsplat returns two radii of each Gaussian, as it does since 1.5.

    """

    settings: tuple[str, ...] = SETTINGS
    inputs: tuple[str, ...] = _INPUTS
    outputs: tuple[str, ...] = ("color", "radii")
    has_radii_per_axis: bool = True

    def bound(self, arguments: Sequence[Any], named: Mapping[str, Any]) -> dict[str, Any]:
        """Return the arguments of a call of the rasterizer by name, without those that are None.

        Raise TypeError for an argument that gspure does not have.
        """
        values = dict(zip(self.inputs, arguments, strict=False)) | dict(named)
        values = {name: value for name, value in values.items() if value is not None}
        unknown = values.keys() - KNOWN_INPUTS
        if unknown or len(arguments) > len(self.inputs):
            raise TypeError(
                f"gspure cuda-free: the rasterizer takes no {', '.join(sorted(unknown)) or 'further argument'}"
            )
        return values


DIALECTS: Final = {
    "inria": Dialect((*SETTINGS, "antialiasing"), outputs=("color", "radii", "inverse_depth")),
    "inria-2023": Dialect(),
    "depth": Dialect(outputs=("color", "radii", "depth")),
    "depth-alpha": Dialect(outputs=("color", "radii", "depth", "alpha")),
    "feature-3dgs": Dialect(
        inputs=(*_INPUTS[:4], "semantic_feature", *_INPUTS[4:]), outputs=("color", "features", "radii", "depth")
    ),
    "gs-hider": Dialect(inputs=(*_INPUTS[:3], "semantic_feature", *_INPUTS[5:]), outputs=("features", "radii")),
    "gsplat-1.4": Dialect(has_radii_per_axis=False),
}
"""Dialects by name. `inria` is INRIA's of today, `inria-2023` its first, which Scaffold-GS uses, too."""


def find_wrapper(folder: Path) -> Path | None:
    """Return the Python wrapper of the rasterizer in a checkout, at most four folders below `folder`."""
    patterns = ("/".join(["*"] * depth + [PACKAGE, "__init__.py"]) for depth in range(4))
    wrappers = (path for pattern in patterns for path in sorted(folder.glob(pattern)))
    return next((path for path in wrappers if not path.resolve().is_relative_to(Path(__file__).parent)), None)


def read_dialect(wrapper: Path) -> Dialect:
    """Return the dialect of a wrapper. It is parsed, and nothing in it is executed.

    Raise `InputError` if it has a setting or returns an output that gspure does not have.
    """
    with reading(wrapper, "the wrapper of a rasterizer"):
        tree = ast.parse(wrapper.read_text(encoding="utf-8"))
        bodies = {node.name: node.body for node in tree.body if isinstance(node, ast.ClassDef)}
        fields = [node.target for node in bodies["GaussianRasterizationSettings"] if isinstance(node, ast.AnnAssign)]
        settings = tuple(field.id for field in fields if isinstance(field, ast.Name))
        forward = _forward(bodies["GaussianRasterizer"])
        inputs = tuple(argument.arg for argument in forward.args.args[1:])
        returned = tuple(_returned(_forward(bodies["_RasterizeGaussians"])))
    meanings = {name: meaning for meaning, names in NAMES_OF_OUTPUTS.items() for name in names}
    _refuse_unknown(wrapper, "settings", settings, KNOWN_SETTINGS)
    _refuse_unknown(wrapper, "outputs", returned, meanings.keys())
    if missing := [name for name in SETTINGS if name not in settings]:
        raise InputError(wrapper, "settings", expected=", ".join(missing), found=", ".join(settings))
    return Dialect(settings, inputs, tuple(meanings[name] for name in returned))


def _forward(body: Sequence[ast.stmt]) -> ast.FunctionDef:
    """Return the function `forward` of a class."""
    functions = {node.name: node for node in body if isinstance(node, ast.FunctionDef)}
    return functions["forward"]


def _returned(function: ast.FunctionDef) -> Iterator[str]:
    """Yield the names that a function returns."""
    values = [node.value for node in ast.walk(function) if isinstance(node, ast.Return)]
    elements = values[-1].elts if isinstance(values[-1], ast.Tuple) else values
    for element in elements:
        yield ast.unparse(element) if element else "None"


def _refuse_unknown(wrapper: Path, field: str, names: Sequence[str], known: Any) -> None:
    """Refuse a wrapper with names that are not known."""
    unknown = [name for name in names if name not in known]
    if unknown:
        hint = "gspure cuda-free --dialect NAME takes another dialect"
        expected = f"some of {', '.join(sorted(known))}"
        raise InputError(wrapper, field, expected=expected, found=", ".join(unknown), hint=hint)
