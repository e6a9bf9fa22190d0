"""Eye-dome lighting: shade a pixel by the distance of its neighbours in front of it (Boucheny 2009).

It shows edges and depth of point clouds, which have no normals. It is applied to the finished picture, since VTK's
filter has a fixed strength, at which the outlines of small dots hide their colours.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

_STRENGTH: Final = 30.0
_DARKEST: Final = 0.4
_DIRECTIONS: Final = 8


def eye_dome(image: NDArray[np.uint8], depth: NDArray[np.float32], radius: int) -> NDArray[np.uint8]:
    """Return the image shaded by depth.

    Parameters
    ----------
    image : uint8 array [H,W,3]
    depth : float32 array [H,W]
        Distance along the view; inf in the background, which is left unchanged.
    radius : int
        Distance to the neighbours in pixels.

    """
    octaves = np.log2(depth)
    height, width = depth.shape
    padded = np.pad(octaves, radius, constant_values=np.inf)
    occlusion = np.zeros_like(depth)
    for angle in np.arange(_DIRECTIONS) * (2 * np.pi / _DIRECTIONS):
        y, x = radius + np.rint(radius * np.array([np.sin(angle), np.cos(angle)])).astype(int)
        with np.errstate(invalid="ignore"):  # inf - inf beside the cloud
            occlusion += np.fmax(octaves - padded[y : y + height, x : x + width], 0)
    shade = _DARKEST + (1 - _DARKEST) * np.exp(-_STRENGTH / _DIRECTIONS * occlusion)
    shade[np.isinf(depth)] = 1
    shaded: NDArray[np.uint8] = np.rint(image * shade[..., None]).astype(np.uint8)
    return shaded
