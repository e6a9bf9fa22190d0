"""What training has seen of anchors, by which they grow and go (Scaffold-GS, section 3.3)."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from gspure.cameras.camera import Camera
from gspure.schemes.secure_gs.neural import Neural

Float32 = NDArray[np.float32]


class Statistics:
    """Sums over the views of one branch, since each was last reset.

    Parameters
    ----------
    count, k : int
        Anchors M, and Gaussians of each.

    Attributes
    ----------
    norms, seen : array [M,k]
        Sum of the gradients' norms (see `screen_norms`), and in how many views a Gaussian was active.
    places : array [M,k,3]
        Sum of a Gaussian's centres in those views.
    opacities, visits : array [M]
        Sum of an anchor's opacities, and how many views had it.

    """

    def __init__(self, count: int, k: int) -> None:
        self.norms = np.zeros((count, k), np.float32)
        self.seen = np.zeros((count, k), np.float32)
        self.places = np.zeros((count, k, 3), np.float32)
        self.opacities = np.zeros(count, np.float32)
        self.visits = np.zeros(count, np.float32)

    def note(self, rows: NDArray[np.intp], found: Neural, norms: Float32) -> None:
        """Add a view: the `rows` [V] of its anchors, their Gaussians (as arrays), the norms [A] of their gradients."""
        k = self.seen.shape[1]
        self.visits[rows] += 1
        self.opacities[rows] += np.maximum(found.outputs, 0).sum(axis=1)
        places = rows[found.active // k], found.active % k
        self.seen[places] += 1
        self.norms[places] += norms
        self.places[places] += found.means

    def means(self) -> tuple[Float32, Float32]:
        """Return the mean norm [M,k] and the mean centre [M,k,3] of each Gaussian."""
        seen = np.maximum(self.seen, np.float32(1))
        return np.asarray(self.norms / seen), np.asarray(self.places / seen[..., None])

    def forget(self, gaussians: NDArray[np.bool_], anchors: NDArray[np.bool_]) -> None:
        """Begin anew for these Gaussians [M,k] and these anchors [M]."""
        for sums, mask in ((self.norms, gaussians), (self.seen, gaussians), (self.places, gaussians)):
            sums[mask] = 0
        self.opacities[anchors] = self.visits[anchors] = 0

    def follow(self, kept: NDArray[np.intp], new: int) -> None:
        """Keep the sums of the anchors that stay, and begin those of new ones."""
        for name, sums in vars(self).items():
            setattr(self, name, np.concatenate([sums[kept], np.zeros((new, *sums.shape[1:]), np.float32)]))


def screen_norms(camera: Camera, means: NDArray[Any], gradients: NDArray[Any]) -> Float32:
    """Return the norms [A] of dL/d(projected centre), in 3DGS's NDC units, from dL/d(centre) [A,3].

    Across the line of sight a centre moves its projection by f / z pixels; that its covariance on the screen changes
    too is left out, a share of about scale / depth.
    """
    rotation = camera.viewmat[:3, :3]
    depths = means @ rotation[2] + camera.viewmat[2, 3]
    across = gradients @ rotation[:2].T * depths[:, None] / np.diag(camera.K)[:2]
    return np.asarray(np.linalg.norm(across * (camera.width / 2, camera.height / 2), axis=1), np.float32)
