"""Whether a person can read an extracted message: the share of its edges that the extraction shows in place.

An extraction may fade, recolour or invert a message that is plain to see, and words are gone while walls and floors
still correlate. So this measure compares the strength of edges, which has no sign, in small blocks.
"""

from collections.abc import Iterator, Sequence
from typing import Final

import numpy as np

from gspure.arrays import Float32, Float64
from gspure.images import is_blank

READABLE: Final = 0.8  # least share of blocks in a readable message: experiments/tables/legibility.csv
TRACES: Final = 0.4  # the same for traces; wrong messages of small pictures reach 0.33
MATCH: Final = 0.4  # least correlation of the edges in a block that shows the message
BLOCKS: Final = (6, 8)  # of a picture, down and across


def legibility(extractions: Sequence[Float32], messages: Sequence[Float32]) -> float:
    """Return the reading score R, 0 to 1, of extracted views [H,W,3] of a message.

    R is the share of blocks in which the strength of edges correlates with the message's by at least `MATCH`, mean over
    views. The half of the 8 x 6 blocks counts in which the message has most gradient energy, without flat ones.
    """
    return float(np.mean([_share(*pair) for pair in zip(extractions, messages, strict=True)]))


def _share(extraction: Float32, message: Float32) -> float:
    if is_blank(extraction):
        return 0.0
    energy = _energy(message)
    energies = np.array([block.sum() for block in _blocks(energy)])
    busiest = np.argsort(-energies, kind="stable")[: len(energies) // 2]
    shown = [*_blocks(_strength(_energy(extraction)))]
    hidden = [*_blocks(_strength(energy))]
    matches = [_correlation(shown[i], hidden[i]) >= MATCH for i in busiest if energies[i] > 0]
    return float(np.mean(matches)) if matches else 0.0


def _energy(image: Float32) -> Float64:
    """Return the squared norm [H,W] of the gradient in colour, by forward differences."""
    pixels = image.astype(np.float64)
    down = np.diff(pixels, axis=0, append=pixels[-1:])
    across = np.diff(pixels, axis=1, append=pixels[:, -1:])
    return np.asarray((down**2 + across**2).sum(axis=2))


def _strength(energy: Float64) -> Float64:
    """Return the root of the gradient's norm, which weakens outliers, blurred: edges may be off by a pixel."""
    strength = energy**0.25
    for axis in (0, 1):
        padding = [(1, 1) if i == axis else (0, 0) for i in (0, 1)]
        padded = np.pad(strength, padding, mode="edge")
        before, middle, after = (padded.take(np.arange(strength.shape[axis]) + i, axis) for i in range(3))
        strength = (before + 2 * middle + after) / 4
    return strength


def _blocks(plane: Float64) -> Iterator[Float64]:
    """Yield the blocks of a plane [H,W], row by row."""
    for band in np.array_split(plane, BLOCKS[0], axis=0):
        yield from np.array_split(band, BLOCKS[1], axis=1)


def _correlation(a: Float64, b: Float64) -> float:
    """Return the correlation of two blocks; 0 if either is constant."""
    a = a - a.mean()
    b = b - b.mean()
    norm = np.sqrt(np.sum(a * a) * np.sum(b * b))
    return float(np.sum(a * b) / norm) if norm > 0 else 0.0
