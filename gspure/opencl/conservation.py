"""Conservation of light, a property of the contributions of any model to any view."""

import numpy as np
from numpy.typing import NDArray

from gspure.constants import ALPHA_MAX
from gspure.errors import InputError
from gspure.files import Float32

TOLERANCE = 1e-4  # relative, of the sum over a view; rounding errors stay below a tenth of it

_HINT = "the OpenCL driver computes wrongly; choose another device: `gspure doctor`"


def require_conservation(view: str, contributions: NDArray[np.void], transmittance: Float32) -> None:
    """Check that contributions and transmittance [H,W] of a view are shares of the light and add up to all of it.

    Raise `InputError` with view, row (or pixel) and value, if a sum or maximum of a row is negative, infinite or not a
    number, a maximum exceeds `ALPHA_MAX`, a transmittance lies outside 0 to 1, or the sums do not add up to the light
    that the transmittance lacks.
    """
    largest = {"sum": np.finfo(np.float32).max, "max": np.float32(ALPHA_MAX)}
    for name, most in largest.items():
        values = contributions[name]
        if len(values) and not (values.min() >= 0 and values.max() <= most):  # false for NaN
            wrong = np.flatnonzero(~((values >= 0) & (values <= most)))[0]
            row, value = contributions["index"][wrong], values[wrong]
            raise _violation(view, f"contribution ({name})", f"0 to {most:.3g}", f"{value} in row {row}")
    if not (transmittance.min() >= 0 and transmittance.max() <= 1):
        y, x = np.argwhere(~((transmittance >= 0) & (transmittance <= 1)))[0]
        raise _violation(view, "transmittance", "0 to 1", f"{transmittance[y, x]} in column {x}, line {y}")
    gathered = float(contributions["sum"].sum(dtype=np.float64))
    absorbed = transmittance.size - float(transmittance.sum(axis=1).sum(dtype=np.float64))  # of lines: half the time
    if abs(gathered - absorbed) > TOLERANCE * max(absorbed, 1.0):
        row = contributions["index"][contributions["sum"].argmax()] if len(contributions) else "none"
        found = f"{gathered:.7g} (largest in row {row})"
        raise _violation(view, "sum of contributions", f"{absorbed:.7g}, the light that the transmittance lacks", found)


def _violation(view: str, field: str, expected: str, found: str) -> InputError:
    return InputError(f"view {view}", field, expected=expected, found=found, hint=_HINT)
