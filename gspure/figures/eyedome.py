"""Eye-dome lighting: shade a pixel by how far its neighbours stand before it (Boucheny 2009).

It gives point clouds, which have no normals, edges and depth. Done on the finished picture rather than in VTK, whose
own filter has a fixed strength that drowns the colours of small dots in their outlines.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

_STRENGTH: Final = 30.0
_DARKEST: Final = 0.4
_DIRECTIONS: Final = 8


def eye_dome(image: NDArray[np.uint8], depth: NDArray[np.float32], radius: int) -> NDArray[np.uint8]:
    """Return the image with depth made visible.

    Parameters
    ----------
    image : uint8 array [H,W,3]
    depth : float32 array [H,W]
        Distance along the view, inf where there is nothing; such pixels stay as they are.
    radius : int
        Distance in pixels to the neighbours that are looked at.

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
