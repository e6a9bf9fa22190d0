"""The buffers that an engine keeps from frame to frame."""

from collections.abc import Callable
from math import prod
from typing import Any

import pyopencl as cl
from numpy.typing import NDArray

Allocate = Callable[[int], cl.Buffer]
Copy = Callable[[NDArray[Any], cl.Buffer], cl.Buffer]


class Scratch:
    """A buffer that grows as needed; growing loses its contents."""

    def __init__(self, allocate: Allocate, copy: Copy) -> None:
        self._allocate = allocate
        self._copy = copy
        self._buffer: cl.Buffer | None = None

    def sized(self, *shape: int) -> cl.Buffer:
        """Return the buffer, with room for at least `shape` numbers of 4 bytes."""
        nbytes = 4 * prod(shape)
        if self._buffer is None or self._buffer.size < nbytes:
            if self._buffer is not None:
                self._buffer.release()
            self._buffer = self._allocate(nbytes)
        return self._buffer

    def holding(self, array: NDArray[Any]) -> cl.Buffer:
        """Return the buffer, with a copy of `array`."""
        return self._copy(array, self.sized(-(-array.nbytes // 4)))


class Buffers:
    """Buffers of the steps of a frame, each for one purpose.

    Shapes: K Gaussians in blocks of 16, V visible ones, H x W pixels, C channels, T tiles of a band, at most E entries,
    P chunks of a counting sort.
    """

    # Gaussians that every frame uploads
    geometry: Scratch  # [K,GEOMETRY_ATTRIBUTES]
    channels: Scratch  # [K,CHANNEL_ATTRIBUTES]
    # projection
    camera: Scratch  # [24]
    splats: Scratch  # [K,SPLAT]
    footprints: Scratch  # [K,FOOTPRINT_FLOATS]
    areas: Scratch  # [K]
    depth_keys: Scratch  # [K]
    # ordering
    even_pairs: Scratch  # [K,2]
    odd_pairs: Scratch  # [K,2]
    positions: Scratch  # [K]
    digit_starts: Scratch  # [digits + 1]
    # counting sorts
    histogram: Scratch  # [P,bins]
    totals: Scratch  # [bins]
    # binning
    bounds: Scratch  # [P]
    band_bounds: Scratch  # [P]
    chunk_starts: Scratch  # [P+1]
    chunk_ends: Scratch  # [P]
    slot_ranges: Scratch  # [V,2]
    first_slots: Scratch  # [V+1]
    slot_positions: Scratch  # [E]
    spare_pairs: Scratch  # [E,2]
    emitted: Scratch  # [E,2]
    entries: Scratch  # [E,2]
    tile_starts: Scratch  # [T+1]
    # blending
    background: Scratch  # [C]
    image: Scratch  # [H,W,C]
    transmittance: Scratch  # [H,W]
    median_depth: Scratch  # [H,W]
    partials: Scratch  # [E,3]
    records: Scratch  # [K,4]
    # opacities of points
    points: Scratch  # [items,3,LANES]
    point_tiles: Scratch  # [items]
    point_values: Scratch  # [items,LANES]
    point_owners: Scratch  # [items,LANES]
    # the backward pass and training
    image_gradient: Scratch  # [H,W,C]
    vector_losses: Scratch  # [H,vectors]
    slot_gradients: Scratch  # [E,MOMENTS+C]
    splat_gradients: Scratch  # [K,MOMENTS+C]
    geometry_gradients: Scratch  # [K,GEOMETRY_ATTRIBUTES]
    channel_gradients: Scratch  # [K,CHANNEL_ATTRIBUTES]
    centre_gradients: Scratch  # [K,2]
    rates: Scratch  # [GEOMETRY_ATTRIBUTES]

    def __init__(self, allocate: Allocate, copy: Copy) -> None:
        for name in Buffers.__annotations__:
            setattr(self, name, Scratch(allocate, copy))
