r"""Attacks that draw the scene with other Gaussians: split ones, and merged pairs (ours).

A Gaussian of deviation s along its longest axis becomes two with deviation :math:`s \sqrt{1 - d^2}` at distances
:math:`\pm d s`, which together have its centre and covariance. Seen face-on, two overlapping Gaussians of opacity
:math:`\alpha'` cover the area of one of opacity :math:`\alpha` if

.. math:: \sqrt{1 - d^2} \left(2 \alpha' - \tfrac12 \alpha'^2 e^{-d^2 / (1 - d^2)}\right) = \alpha

A merged Gaussian has the centre, the covariance and the covered area of a pair.
"""

from typing import Final

import numpy as np

from gspure.arrays import Float64, Indices
from gspure.attacks.attack import Rng, named
from gspure.attacks.attacked import Attacked, require_attribute
from gspure.attacks.strength import Strength
from gspure.model.frames import frame_columns
from gspure.model.gaussians import LEAST_OPACITY, SCALES, Gaussians, logit
from gspure.model.rotations import principal_axes
from gspure.public_model import Columns
from gspure.settings import Share

APART: Final = 0.5  # d; ours
SPLIT: Final = 0.25  # fraction of the rows to split; ours
MERGED: Final = 0.1  # fraction of the rows to merge into others; ours


def split(model: Gaussians, rng: Rng, columns: Columns, *, fraction: Share = SPLIT) -> Attacked:
    """Split a random `fraction` (0 to 1) of the Gaussians in two along their longest axes; the new rows come last.

    The halves have together the centre and the covariance of their row, and cover the same area.

    Source: ours.
    """
    require_attribute("split", columns, "opacity")
    count = len(model)
    axes = principal_axes(model)
    eligible = np.flatnonzero(np.isfinite(axes).all(axis=(1, 2)))
    chosen = np.sort(rng.choice(eligible, round(fraction * len(eligible)), replace=False))
    rows = np.concatenate([np.arange(count), chosen])
    halves = np.concatenate([chosen, np.arange(count, len(rows))])
    parents = rows[halves]
    longest = model.log_scales[parents].argmax(axis=1)
    sides = np.repeat([-1.0, 1.0], len(chosen))
    means = model.means[rows].astype(np.float64)
    means[halves] += APART * sides[:, None] * axes[parents, longest]
    log_scales = model.log_scales[rows]
    log_scales[halves, longest] += np.float32(np.log(1 - APART**2) / 2)
    logits = model.table["opacity"][rows]
    logits[halves] = logit(_half(model.opacities[parents].astype(np.float64)), LEAST_OPACITY)
    values = dict(zip(("x", "y", "z", *SCALES), [*means.astype(np.float32).T, *log_scales.T], strict=True))
    return Attacked.copied(model, rows, values | {"opacity": logits})


def _half(opacities: Float64) -> Float64:
    """Return the opacities [K] of the halves of Gaussians, the solutions of the equation above."""
    overlap = np.exp(-(APART**2) / (1 - APART**2))
    wanted = opacities / np.sqrt(1 - APART**2)
    return np.asarray((2 - np.sqrt(4 - 2 * overlap * wanted)) / overlap)


def merge_pairs(model: Gaussians, _rng: Rng, columns: Columns, *, fraction: Share = MERGED) -> Attacked:
    """Merge pairs of mutual nearest neighbours, those most alike first, to remove a `fraction` (0 to 1) of the rows.

    A merged row has the pair's centre, covariance and covered area, and the weighted mean of its colours. It replaces
    the one that covers more. There are fewer such pairs than half of the rows.

    Source: ours.
    """
    require_attribute("merge_pairs", columns, "opacity")
    opacities = model.opacities.astype(np.float64)
    areas = opacities * np.sort(model.scales.astype(np.float64), axis=1)[:, 1:].prod(axis=1)
    pairs = _pairs(model, columns, areas)[: round(fraction * len(model))]
    pairs = np.where((areas[pairs[:, 0]] < areas[pairs[:, 1]])[:, None], pairs[:, ::-1], pairs)
    shares = areas[pairs] / areas[pairs].sum(axis=1, keepdims=True)
    means = model.means.astype(np.float64)[pairs]
    centres = np.einsum("pi,pix->px", shares, means)
    axes = principal_axes(model)[pairs]
    offsets = means - centres[:, None]
    covariances = np.einsum("pi,piax,piay->pxy", shares, axes, axes)
    covariances += np.einsum("pi,pix,piy->pxy", shares, offsets, offsets)
    values = dict(zip("xyz", centres.T, strict=True)) | _shapes(covariances, areas[pairs], opacities[pairs])
    for name in columns["colour"]:
        values[name] = (shares * model.table[name][pairs]).sum(axis=1)
    merged = model.table.copy()
    for name, column in values.items():
        merged[name][pairs[:, 0]] = column
    kept = np.delete(np.arange(len(model)), pairs[:, 1])
    return Attacked(Gaussians(merged[kept], model.comments), kept, len(model))


def _pairs(model: Gaussians, columns: Columns, areas: Float64) -> Indices:
    """Return the pairs [P,2] of mutual nearest neighbours that cover an area, those most alike first.

    Unlike are pairs that are far apart for their size, or of different colours.
    """
    from scipy.spatial import KDTree

    drawn = np.flatnonzero(np.isfinite(principal_axes(model)).all(axis=(1, 2)) & (areas > 0))
    if len(drawn) < 2:
        return np.zeros((0, 2), np.intp)
    distances, neighbours = KDTree(model.means[drawn]).query(model.means[drawn], k=2)
    nearest = np.where(neighbours[:, 0] == np.arange(len(drawn)), neighbours[:, 1], neighbours[:, 0])
    first = np.flatnonzero((nearest[nearest] == np.arange(len(drawn))) & (np.arange(len(drawn)) < nearest))
    pairs = drawn[np.stack([first, nearest[first]], axis=1)]
    sizes = model.scales.max(axis=1)[pairs].mean(axis=1)
    colours = model.columns(*columns["base_colour"])[pairs]
    unlikeness = distances[first].max(axis=1) / sizes + np.linalg.norm(colours[:, 0] - colours[:, 1], axis=1)
    return np.asarray(pairs[np.argsort(unlikeness, kind="stable")])


def _shapes(covariances: Float64, areas: Float64, opacities: Float64) -> dict[str, Float64]:
    """Return the columns of merged Gaussians: frames of the covariances [P,3,3], and opacities.

    `areas` [P,2] and `opacities` [P,2] are those of the pairs, whose smaller member overlaps the other one.
    """
    from scipy.spatial.transform import Rotation

    variances, vectors = np.linalg.eigh(covariances)
    vectors[:, :, 0] *= np.linalg.det(vectors)[:, None]
    scales = np.sqrt(np.maximum(variances, np.finfo(np.float32).tiny))
    quats = Rotation.from_matrix(vectors).as_quat(scalar_first=True)
    overlaps = areas.min(axis=1) * opacities.max(axis=1) / 2
    covered = (areas.sum(axis=1) - overlaps) / scales[:, 1:].prod(axis=1)
    return frame_columns(quats, np.log(scales)) | {"opacity": logit(covered, LEAST_OPACITY)}


ATTACKS = named({split: Strength("fraction", 0.0, 1.0), merge_pairs: Strength("fraction", 0.0, 0.5)})
