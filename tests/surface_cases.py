"""Small models with a known surface, and views of them from all around."""

import numpy as np

from tests.models import camera, gaussians, joined

RADIUS = 1.0
THICKNESS = 0.02
DEVIATION = np.hypot(THICKNESS, np.sqrt(0.2) * (4 - RADIUS) / 58)
"""Across a disc of `ball`, filtered. The field is one half one or two of them before the centres: discs overlap."""


def around(distance=4.0, size=48):
    """Six views of the origin, along the axes."""
    views = []
    for i, (axis, up) in enumerate(((0, 1), (1, 2), (2, 0))):
        for sign in (1, -1):
            rows = np.zeros((3, 3))
            rows[2, axis] = -sign
            rows[1, up] = 1
            rows[0] = np.cross(rows[1], rows[2])
            viewmat = np.eye(4)
            viewmat[:3, :3], viewmat[2, 3] = rows, distance
            views.append(camera(size, size, focal=1.2 * size, viewmat=viewmat, name=f"view_{2 * i + (sign < 0)}"))
    return views


def directions(count):
    """Points spread evenly over the unit sphere (Fibonacci)."""
    z = 1 - (2 * np.arange(count) + 1) / count
    angle = np.pi * (1 + np.sqrt(5)) * np.arange(count)
    return np.stack([np.sqrt(1 - z * z) * np.cos(angle), np.sqrt(1 - z * z) * np.sin(angle), z], axis=1)


def ball(count=300, radius=RADIUS, opacity=0.95):
    """Discs that tile a sphere, flat along its radius."""
    normals = directions(count)
    # (1 + n.z, z x n) turns the z axis onto n
    quats = np.stack([1 + normals[:, 2], -normals[:, 1], normals[:, 0], np.zeros(count)], axis=1)
    side = 1.2 * radius * np.sqrt(4 * np.pi / count) / 2
    return gaussians(means=radius * normals, quats=quats, scales=[side, side, THICKNESS], opacities=opacity)


def populated():
    """A ball; a layer hidden in it; a floater in its middle; faint floaters around it. With the part of each row."""
    faint = gaussians(means=1.7 * directions(12), scales=0.05, opacities=0.3)
    parts = [ball(), ball(80, radius=0.6), gaussians(means=[0, 0, 0], scales=0.05, opacities=0.9), faint]
    return joined(*parts), np.repeat(np.arange(4), [len(part) for part in parts])
