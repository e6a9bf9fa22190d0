"""Blend tile lists into pixels, and sum the contributions of each Gaussian."""

from dataclasses import dataclass

import pyopencl as cl

from gspure.arrays import Float32
from gspure.constants import TILE
from gspure.opencl.binning import TileLists
from gspure.opencl.engine import Program
from gspure.opencl.frame import Frame
from gspure.opencl.projection import Projected

_PIXELS = TILE * TILE
SUM_GROUP = 64  # work-group of the kernels that handle one Gaussian per work-item in both styles


@dataclass(frozen=True)
class Canvas:
    """Device buffers that a frame accumulates in: pixels [H,W,...] and contributions by row [K]."""

    image: cl.Buffer
    transmittance: cl.Buffer
    median_depth: cl.Buffer
    records: cl.Buffer


def prepare_canvas(frame: Frame) -> Canvas:
    """Return the canvas of a frame; its contributions are zero."""
    buffers = frame.engine.buffers
    traversal = frame.traversal
    rows = frame.storage.count if traversal.contributions else 0
    canvas = Canvas(
        buffers.image.sized(*frame.size, traversal.channels),
        buffers.transmittance.sized(*frame.size),
        buffers.median_depth.sized(*frame.size, int(traversal.median_depth)),
        buffers.records.sized(rows, 4),
    )
    frame.engine.clear(canvas.records, 16 * rows)
    return canvas


def blend_band(frame: Frame, projected: Projected, lists: TileLists, background: Float32, canvas: Canvas) -> None:
    """Blend one band of tiles into `canvas` (blending_cpu.cl, blending_gpu.cl)."""
    engine = frame.engine
    buffers = engine.buffers
    traversal = frame.traversal
    batch = {"BATCH": _batch(frame)} if engine.style == "gpu" else {}
    program = frame.program(
        "vector",
        "layout",
        "blending",
        f"blending_{engine.style}",
        CONTRIBUTIONS=int(traversal.contributions),
        MEDIAN_DEPTH=int(traversal.median_depth),
        **batch,
    )
    slots = lists.capacity if traversal.contributions else 0
    partials = buffers.partials.sized(slots, 3)
    outputs = (canvas.image, canvas.transmittance, canvas.median_depth, partials)
    walk_tiles(program, "blend_tiles", frame, projected, lists, buffers.background.holding(background), *outputs)


def walk_tiles(
    program: Program, kernel: str, frame: Frame, projected: Projected, lists: TileLists, *args: cl.Buffer
) -> None:
    """Launch `kernel` over the tiles of a band: one work-item per tile (cpu style), or per pixel (gpu style)."""
    group = _PIXELS if frame.engine.style == "gpu" else 1
    columns, _ = frame.tiles
    program.launch(
        kernel,
        len(lists.band) * columns * group,
        *frame.size,
        columns,
        lists.band.start * columns,
        projected.splats,
        lists.entries,
        lists.tile_starts,
        *args,
        group=group,
    )


def sum_slots(frame: Frame, lists: TileLists, canvas: Canvas) -> None:
    """Add the slots of a band to the contributions of their Gaussians (contributions.cl)."""
    order = lists.order
    partials = frame.engine.buffers.partials.sized(lists.capacity, 3)
    arguments = (order.visible, order.positions, frame.storage.rows, lists.slot_ranges, partials, canvas.records)
    program = frame.engine.program("contributions", FIRST_BAND=int(lists.band.start == 0))
    program.launch("sum_slots", order.visible, *arguments, group=SUM_GROUP)


def _batch(frame: Frame) -> int:
    """Return the number of splats that a work-group loads at a time: a power of two.

    They fill at most three quarters of its local memory.
    """
    sums = 3 if frame.traversal.contributions else 0
    entry = 4 * (frame.traversal.staged_floats + sums)
    fitting = frame.engine.device.local_mem_size * 3 // 4 // entry
    return min(_PIXELS, 1 << max(int(fitting).bit_length() - 1, 0))
