"""Statistics of a model, the content of ``gspure info``."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gspure.files import Float32, Indices
from gspure.model.finite import non_finite_rows
from gspure.model.gaussians import COLOUR, CORE, NORMALS, Gaussians
from gspure.model.signature import Signature
from gspure.model.suspicious import suspicious_rows

LEVELS = (0.0, 0.05, 0.25, 0.5, 0.75, 0.95, 1.0)  # quantile levels: extremes, the middle 90 %, quartiles and median


@dataclass(frozen=True)
class Summary:
    """Statistics of a model.

    `sh_degree` is -1 without colour; `further_columns` are those that vanilla models do not have. The quantiles at
    `LEVELS` are those of the finite values of x, y, z (world units), opacity (0 to 1), largest_scale and smallest_scale
    (of each Gaussian's three standard deviations, world units); empty if no value is finite. `non_finite_rows` have an
    infinity or a not-a-number in any column; `non_finite_columns` are, for each such column, the number of these rows
    and the first of them. `repeated_position_rows` have exactly the centre of an earlier row. For `suspicious`, see
    `gspure.model.suspicious`.
    """

    gaussians: int
    sh_degree: int
    signature: Signature
    columns: tuple[str, ...]
    further_columns: tuple[str, ...]
    quantiles: dict[str, tuple[float, ...]]
    non_finite_rows: int
    non_finite_columns: dict[str, tuple[int, int]]
    zero_quaternion_rows: int
    repeated_position_rows: int
    suspicious: dict[str, Indices]


def summarize(model: Gaussians) -> Summary:
    """Return statistics of `model`."""
    with np.errstate(invalid="ignore"):  # signalling not-a-numbers
        return _summarized(model)


def _summarized(model: Gaussians) -> Summary:
    vanilla = {*CORE, *COLOUR, *NORMALS, *model.columns_named("f_rest_")}
    non_finite = non_finite_rows(model, model.names)
    return Summary(
        gaussians=len(model),
        sh_degree=model.sh_degree,
        signature=Signature.of(model.names),
        columns=model.names,
        further_columns=tuple(name for name in model.names if name not in vanilla),
        quantiles={name: _quantiles(values) for name, values in _quantities(model).items()},
        non_finite_rows=len(set().union(*(rows.tolist() for rows in non_finite.values()))),
        non_finite_columns={name: (len(rows), int(rows[0])) for name, rows in non_finite.items()},
        zero_quaternion_rows=int(np.count_nonzero(~model.quats.any(axis=1))),
        repeated_position_rows=_repeated(model.means),
        suspicious=suspicious_rows(model),
    )


def _quantities(model: Gaussians) -> dict[str, Float32]:
    return {
        **dict(zip("xyz", model.means.T, strict=True)),
        "opacity": model.opacities,
        "largest_scale": model.scales.max(axis=1),
        "smallest_scale": model.scales.min(axis=1),
    }


def _quantiles(values: Float32) -> tuple[float, ...]:
    finite = values[np.isfinite(values)]
    return tuple(np.quantile(finite, LEVELS).tolist()) if len(finite) else ()


def _repeated(means: Float32) -> int:
    finite = means[np.isfinite(means).all(axis=1)] + np.float32(0)  # -0 becomes 0: equal numbers, equal bits
    rows: NDArray[Any] = finite.view("V12")
    return len(rows) - len(np.unique(rows))
