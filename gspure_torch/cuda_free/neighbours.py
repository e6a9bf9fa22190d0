"""Distances to neighbours, by which 3DGS chooses its first scales."""

import numpy as np

from gspure_torch.pytorch import on_host, torch

_NEIGHBOURS = 3


def distCUDA2(points: torch.Tensor) -> torch.Tensor:  # noqa: N802
    """Return the mean squared distance [K] of each of the `points` [K,3] to its three nearest neighbours."""
    from scipy.spatial import cKDTree

    positions = on_host(points).astype(np.float64)
    distances, _ = cKDTree(positions).query(positions, k=_NEIGHBOURS + 1, workers=-1)
    squares = (distances[:, 1:] ** 2).mean(axis=1)
    return torch.from_numpy(squares.astype(np.float32)).to(points.device)
