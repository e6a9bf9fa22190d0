"""The passes of a frame: forward to pixels, backward from their gradient; and the check that light is conserved."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pyopencl as cl
from numpy.typing import NDArray

from gspure.arrays import Float32
from gspure.cameras.camera import Camera
from gspure.constants import ALPHA_MAX
from gspure.errors import InputError
from gspure.opencl.binning import Bounds, TileLists, bands, bin_tiles, bound_entries
from gspure.opencl.blending import Canvas, blend_band, prepare_canvas, sum_slots
from gspure.opencl.frame import Frame, Traversal
from gspure.opencl.gradients import DeviceGradients, blend_band_backward, project_backward
from gspure.opencl.ordering import sort_by_depth
from gspure.opencl.projection import Projected, project

ENTRY_BUDGET = 1 << 26
"""Most tile entries held at a time; at 28 bytes each, 1.9 GB. Larger frames are rendered in bands, to the same bits."""

TOLERANCE = 1e-4  # relative, of the sum over a view; rounding errors stay below a tenth of it

_HINT = "the OpenCL driver computes wrongly; choose another device: `gspure doctor`"


@dataclass(frozen=True)
class Rendered:
    """A frame on the device, valid until its engine renders the next one; `lists` are those of the last band."""

    frame: Frame
    projected: Projected
    bounds: Bounds
    bands: list[range]
    lists: TileLists
    canvas: Canvas
    background: Float32

    @property
    def shape(self) -> tuple[int, int, int]:
        """The shape [H,W,C] of the image."""
        return self.frame.camera.height, self.frame.camera.width, self.frame.traversal.channels

    def image(self) -> np.ndarray[tuple[int, ...], np.dtype[np.float32]]:
        """Read the image [H,W,C]."""
        return self.frame.engine.read(self.canvas.image, self.shape, np.float32)

    def is_on_black(self, camera: Camera, traversal: Traversal) -> bool:
        """Return whether this is a frame of a camera and a traversal on black."""
        frame = self.frame
        return frame.camera is camera and frame.traversal == traversal and not self.background.any()

    def image_on_white(self) -> Float32:
        """Read an image on black as it is on white: the background's share, times one, is the last that is added."""
        transmittance = self.frame.engine.read(self.canvas.transmittance, self.shape[:2], np.float32)
        return np.asarray(self.image() + transmittance[..., None])


def forward(frame: Frame, background: Sequence[float] = (0.0,), entry_budget: int = ENTRY_BUDGET) -> Rendered:
    """Render a frame, with at most `entry_budget` tile entries at a time.

    `background` has one value per channel, or a single one if the frame has no channels.
    """
    if len(background) != max(frame.traversal.channels, 1):
        raise ValueError(f"background has {len(background)} values for {frame.traversal.channels} channels")
    colour = np.asarray(background, np.float32)
    projected = project(frame)
    order = sort_by_depth(frame.engine, frame.storage, projected.depth_keys)
    canvas = prepare_canvas(frame)
    bounds = bound_entries(frame, projected, order)
    split = bands(frame, projected, bounds, entry_budget)
    for band in split:
        lists = bin_tiles(frame, projected, bounds, band)
        blend_band(frame, projected, lists, colour, canvas)
        if frame.traversal.contributions:
            sum_slots(frame, lists, canvas)
    return Rendered(frame, projected, bounds, split, lists, canvas, colour)


def backward(rendered: Rendered, image_gradient: cl.Buffer) -> DeviceGradients:
    """Carry dL/dimage [H,W,C] of the last frame back to the Gaussians' parameters (energy "ewa")."""
    frame = rendered.frame
    projected = rendered.projected
    lists = rendered.lists
    for band in rendered.bands:
        if len(rendered.bands) > 1:  # all bands share the lists' buffers
            lists = bin_tiles(frame, projected, rendered.bounds, band)
        splat_gradients = blend_band_backward(frame, projected, lists, rendered.canvas, image_gradient)
    return project_backward(frame, projected, splat_gradients)


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
            row = contributions["index"][wrong]
            raise _violation(view, f"contribution ({name})", f"0 to {most:.3g}", f"{values[wrong]} in row {row}")
    if not (transmittance.min() >= 0 and transmittance.max() <= 1):
        y, x = np.argwhere(~((transmittance >= 0) & (transmittance <= 1)))[0]
        raise _violation(view, "transmittance", "0 to 1", f"{transmittance[y, x]} in column {x}, line {y}")
    gathered = float(contributions["sum"].sum(dtype=np.float64))
    absorbed = transmittance.size - float(transmittance.sum(axis=1).sum(dtype=np.float64))  # of lines: half the time
    if abs(gathered - absorbed) > TOLERANCE * max(absorbed, 1.0):
        row = contributions["index"][contributions["sum"].argmax()] if len(contributions) else "none"
        expected = f"{absorbed:.7g}, the light that the transmittance lacks"
        raise _violation(view, "sum of contributions", expected, f"{gathered:.7g} (largest in row {row})")


def _violation(view: str, field: str, expected: str, actual: str) -> InputError:
    return InputError(f"view {view}", field, expected=expected, found=actual, hint=_HINT)
