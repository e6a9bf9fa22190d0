"""The statistics by which anchors grow and are pruned (Scaffold-GS, section 3.3)."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from gspure.cameras.camera import Camera
from gspure.files import Bools, Float32, Indices
from gspure.schemes.secure_gs.neural import Neural


class Statistics:
    """Sums over the views of one branch, with `count` = M anchors of k Gaussians, since their last reset."""

    def __init__(self, count: int, k: int) -> None:
        self.norms = np.zeros((count, k), np.float32)  # of the gradients: see `screen_norms`
        self.active_views = np.zeros((count, k), np.float32)  # number of views in which a Gaussian was active
        self.centres = np.zeros((count, k, 3), np.float32)  # of the Gaussian in those views
        self.opacities = np.zeros(count, np.float32)  # of an anchor
        self.views = np.zeros(count, np.float32)  # number of views in which it was visible

    def add(self, rows: Indices, gaussians: Neural, norms: Float32) -> None:
        """Add a view: the `rows` [V] of its anchors, their Gaussians (as arrays), the norms [A] of their gradients."""
        k = self.active_views.shape[1]
        self.views[rows] += 1
        self.opacities[rows] += np.maximum(gaussians.outputs, 0).sum(axis=1)
        active = rows[gaussians.active // k] * k + gaussians.active % k
        self.active_views.reshape(-1)[active] += 1
        self.norms.reshape(-1)[active] += norms
        self.centres.reshape(-1, 3)[active] += gaussians.means

    def means(self) -> tuple[Float32, Float32]:
        """Return the mean norm [M,k] and the mean centre [M,k,3] of each Gaussian."""
        views = np.maximum(self.active_views, np.float32(1))
        return np.asarray(self.norms / views), np.asarray(self.centres / views[..., None])

    def reset(self, gaussians: Bools, anchors: Bools) -> None:
        """Zero the sums of these Gaussians [M,k] and these anchors [M]."""
        for sums in (self.norms, self.active_views, self.centres):
            sums[gaussians] = 0
        self.opacities[anchors] = self.views[anchors] = 0

    def replace_anchors(self, rows: Indices, new: int) -> None:
        """Keep the sums of the anchors `rows` and append zeros for new ones."""
        for name, sums in vars(self).items():
            setattr(self, name, np.concatenate([sums[rows], np.zeros((new, *sums.shape[1:]), np.float32)]))


def screen_norms(camera: Camera, means: NDArray[Any], gradients: NDArray[Any]) -> Float32:
    """Return the norms [A] of dL/d(projected centre), in 3DGS's NDC units, from dL/d(centre) [A,3].

    A unit step across the line of sight moves the projection by f / z pixels. The change of the projected covariance,
    a share of about scale / depth, is neglected.
    """
    rotation = camera.viewmat[:3, :3]
    depths = means @ rotation[2] + camera.viewmat[2, 3]
    across = gradients @ rotation[:2].T * depths[:, None] / np.diag(camera.K)[:2]
    return np.asarray(np.linalg.norm(across * (camera.width / 2, camera.height / 2), axis=1), np.float32)
