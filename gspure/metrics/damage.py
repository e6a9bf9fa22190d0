r"""Damage: what an attack takes from a scene and a customer cannot give back.

Whoever renders an attacked model can move the views and correct the colours. So both are undone before images are
compared: the motion by the views, which move with the transform that the attack declares; the colours here, by one
affine map

.. math:: c' = A c + b

of all pixels of all views. A map of each view, or a warp of each image, would hide real damage. It is fitted to the
unattacked renders, not to the photographs: it undoes the attack, and does not improve the model.

Only pixels that the unattacked model covers count, so that a hole is damage and a changed background is none. How many
of them the attacked model leaves uncovered is a second number, `coverage_lost`.
"""

from collections.abc import Sequence
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gspure.arrays import Bools, Float32, Float64

COVERED: Final = 0.5  # least opacity of a covered pixel


class Shown(NamedTuple):
    """What a model shows in some views: renders [H,W,3] in 0 .. 1, and masks [H,W] of the pixels that it covers."""

    images: Sequence[Float32]
    covered: Sequence[Bools]


def covered(transmittance: NDArray[Any]) -> Bools:
    """Return the mask [H,W] of the pixels that a model covers, from `gspure.renderer.Renderer.transmittance`."""
    return np.asarray(1 - transmittance >= COVERED)


def registered_psnr(references: Sequence[NDArray[Any]], unattacked: Shown, attacked: Shown) -> Float64:
    """Return the PSNR [V] in dB of attacked renders against the reference of each view, after the best colour map.

    Only pixels that the unattacked model covers count; a view without any is NaN. The renders stay as they are if the
    map does not help.
    """
    plain = _psnrs(references, attacked.images, unattacked.covered)
    mapped = _psnrs(references, recoloured(unattacked, attacked), unattacked.covered)
    return max(plain, mapped, key=np.nansum)


def damage(photographs: Sequence[NDArray[Any]], unattacked: Shown, attacked: Shown) -> float:
    """Return the drop in dB of the PSNR against photographs that a customer cannot undo, mean over the views.

    Views that equal their photograph, or show nothing of the model, do not count; NaN if none is left.
    """
    before = _psnrs(photographs, unattacked.images, unattacked.covered)
    drops = before - registered_psnr(photographs, unattacked, attacked)
    return _mean(drops[np.isfinite(drops)])


def fidelity(unattacked: Shown, attacked: Shown) -> float:
    """Return the PSNR in dB of attacked against unattacked renders, mean over the views: without photographs.

    Infinite if nothing changed, NaN if the model covers no pixel.
    """
    levels = registered_psnr(unattacked.images, unattacked, attacked)
    return _mean(levels[~np.isnan(levels)])


def coverage_lost(unattacked: Shown, attacked: Shown) -> float:
    """Return the share of the pixels covered before the attack, over all views, that are not covered after it."""
    pairs = zip(unattacked.covered, attacked.covered, strict=True)
    lost = sum(np.count_nonzero(before & ~after) for before, after in pairs)
    return lost / max(sum(map(np.count_nonzero, unattacked.covered)), 1)


def recoloured(unattacked: Shown, attacked: Shown) -> list[Float64]:
    """Return the attacked renders after the affine map of colours that brings them nearest to the unattacked ones.

    The map has the least squared error over the pixels that both cover, of all views together.
    """
    products = np.zeros((4, 4))
    moments = np.zeros((4, 3))
    masks = [before & after for before, after in zip(unattacked.covered, attacked.covered, strict=True)]
    for reference, image, mask in zip(unattacked.images, attacked.images, masks, strict=True):
        colours = _with_one(image[mask])
        products += colours.T @ colours
        moments += colours.T @ np.asarray(reference[mask], np.float64)
    colour_map = np.linalg.lstsq(products, moments, rcond=None)[0]
    return [np.clip(_with_one(image) @ colour_map, 0, 1) for image in attacked.images]


def _with_one(colours: NDArray[Any]) -> Float64:
    """Return colours [...,3] with a one behind each: [...,4]."""
    return np.concatenate([colours, np.ones_like(colours[..., :1])], axis=-1, dtype=np.float64)


def _psnrs(references: Sequence[NDArray[Any]], images: Sequence[NDArray[Any]], masks: Sequence[Bools]) -> Float64:
    """Return the PSNR [V] in dB of the covered pixels of each view."""
    triples = zip(references, images, masks, strict=True)
    differences = [np.subtract(image[mask], reference[mask], dtype=np.float64) for reference, image, mask in triples]
    errors = np.array([np.mean(np.square(each)) if each.size else np.nan for each in differences])
    with np.errstate(divide="ignore"):
        return np.asarray(-10 * np.log10(errors))


def _mean(values: Float64) -> float:
    return float(values.mean()) if values.size else np.nan
