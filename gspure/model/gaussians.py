"""A set of 3D Gaussians, stored as the table of its file: opacities as logits and scales as logarithms."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from numpy.typing import NDArray

import gspure
from gspure.arrays import Float32
from gspure.errors import InputError
from gspure.files import digest
from gspure.text import Described

if TYPE_CHECKING:
    from gspure.cameras.camera import Camera

Table = NDArray[np.void]
Values = NDArray[Any]

SCALES = ("scale_0", "scale_1", "scale_2")
ROTATION = ("rot_0", "rot_1", "rot_2", "rot_3")  # the quaternion w x y z
CORE = ("x", "y", "z", "opacity", *SCALES, *ROTATION)  # of every model
COLOUR = ("f_dc_0", "f_dc_1", "f_dc_2")  # the zeroth spherical harmonic; absent where a network computes colours
NORMALS = ("nx", "ny", "nz")  # zeros that trainers write and nobody uses
REST_COEFFICIENTS = (0, 3, 8, 15)  # number of spherical harmonics beyond the zeroth, by degree
_COLOURS = ("f_dc_", "f_rest_", "semantic_")  # prefixes of columns of colours, or of features that are decoded to them

_BACKGROUND = re.compile("gspure background" + 3 * r" (0\.\d+|1\.0+)")  # comment on the colour behind a model
RENDER_MODE = "SplatRenderMode: "
_RENDER_MODE = re.compile(r"splatrendermode:? *(default|mip|2dgs)|(postshot\.anti_aliasing=|antialiased )[01]")
"""Comments of Brush, Postshot and PlayCanvas that name how a model is to be rendered, in lower case."""

_BLOCK_ROWS = 4096

CERTAIN: Final = 20.0  # a logit whose opacity is 1 in float32
NOTHING: Final = -200.0  # a logit whose opacity is 0, and the logarithm of a size that is 0, in float32
LEAST_OPACITY: Final = 1e-6  # changed opacities are clipped to this .. 1 - this, so that their logits are finite


@dataclass(frozen=True, eq=False, repr=False)
class Gaussians(Described):
    """K Gaussians as a structured array, one row per Gaussian, raw values as stored in a 3DGS PLY.

    Writing the table reproduces the file byte for byte, and subsets of rows are bit-identical. The properties below are
    derived from it.

    Parameters
    ----------
    table : structured array [K]
        Columns ``x y z``, ``opacity`` (logit), ``scale_0..2`` (log), ``rot_0..3`` (quaternion w x y z, any norm), and
        usually ``f_dc_0..2`` and ``f_rest_*`` (spherical harmonics, channel-major); float32, little-endian, in the
        file's order. Further columns are kept unchanged.
    comments : tuple of str
        The file's comment lines.

    """

    table: Table
    comments: tuple[str, ...] = ()

    def __len__(self) -> int:
        return len(self.table)

    def __getitem__(self, rows: Any) -> Gaussians:
        """Return some rows, bit-identical: a slice, a mask [K], or numbers."""
        return Gaussians(np.atleast_1d(self.table[rows]), self.comments)

    @property
    def facts(self) -> dict[str, str]:
        """Size, colour and extent."""
        low, high = np.nanpercentile(self.means, [5, 95], axis=0) if len(self) else np.zeros((2, 3))
        degree = str(self.sh_degree) if self.sh_degree >= 0 else "none"
        extent = " x ".join(f"{length:.3g}" for length in high - low)
        columns = str(len(self.names))
        return {"rows": f"{len(self):,}", "SH degree": degree, "columns": columns, "extent of 90 %": extent}

    @property
    def names(self) -> tuple[str, ...]:
        """The columns, in the file's order."""
        return self.table.dtype.names or ()

    @property
    def has_anchors(self) -> bool:
        """Whether rows are anchors (Scaffold-GS, SecureGS), whose Gaussians a network computes."""
        return {"f_anchor_feat_0", "f_offset_0"} <= {*self.names}

    @cached_property
    def means(self) -> Float32:
        """Centres [K,3], world units."""
        return self.columns("x", "y", "z")

    @cached_property
    def quats(self) -> Float32:
        """Rotations [K,4] as stored: quaternions (w, x, y, z), not normalized."""
        return self.columns(*ROTATION)

    @property
    def log_scales(self) -> Float32:
        """Logarithms [K,3] of `scales`, as stored."""
        return self.columns(*SCALES)

    @cached_property
    def scales(self) -> Float32:
        """Standard deviations [K,3] along the principal axes, world units: exp of the stored values."""
        with np.errstate(over="ignore", invalid="ignore"):
            return np.exp(self.log_scales)

    @cached_property
    def opacities(self) -> Float32:
        """Opacities [K] in (0, 1): sigmoid of the stored logits."""
        return sigmoid(self.columns("opacity")[:, 0])

    @property
    def sh_degree(self) -> int:
        """Degree of the stored spherical harmonics; -1 without colour."""
        if "f_dc_0" not in self.names:
            return -1
        return int(np.sqrt(len(self.columns_named("f_rest_")) // 3 + 1)) - 1

    @cached_property
    def sh_coeffs(self) -> Float32:
        """Spherical-harmonic coefficients [K,S,3], S = (sh_degree + 1)^2; S = 0 without colour."""
        if self.sh_degree < 0:
            return np.zeros((len(self), 0, 3), np.float32)
        rest = self.columns_named("f_rest_")
        stored = len(rest) // 3  # per channel, channel-major
        names = [rest[channel * stored + i] for i in range(stored) for channel in range(3)]
        return self.columns(*COLOUR, *names).reshape(len(self), 1 + stored, 3)

    def sh_coeffs_of(self, degree: int) -> Float32:
        """Return coefficients [K,S,3] of this degree: higher ones are dropped, missing ones are zero."""
        shared = self.sh_coeffs[:, : (degree + 1) ** 2]
        return np.pad(shared, ((0, 0), (0, (degree + 1) ** 2 - shared.shape[1]), (0, 0)))

    def columns_named(self, prefix: str) -> tuple[str, ...]:
        """Return the columns ``<prefix><number>``, ordered by number."""
        pattern = re.compile(re.escape(prefix) + r"(0|[1-9][0-9]{0,8})")
        matching = filter(None, map(pattern.fullmatch, self.names))
        return tuple(match[0] for match in sorted(matching, key=lambda match: int(match[1])))

    def columns(self, *names: str) -> Float32:
        """Return the named columns as one float32 array [K, len(names)]."""
        out = np.empty((len(self), len(names)), np.float32)
        for rows, block in self.blocks():
            for i, name in enumerate(names):
                out[rows, i] = block[name]
        return out

    def geometry_digest(self) -> str:
        """Return a digest of all columns but colours, for results that do not depend on colours."""
        names = sorted(name for name in self.names if not name.startswith(_COLOURS))
        return digest(*names, *(self.table[name] for name in names))

    def blocks(self) -> Iterator[tuple[slice, Table]]:
        """Yield slices and their rows, as many as fit a CPU cache, since memory holds all columns of a row together."""
        for start in range(0, len(self), _BLOCK_ROWS):
            rows = slice(start, start + _BLOCK_ROWS)
            yield rows, self.table[rows]

    def with_columns(self, values: Mapping[str, Values]) -> Gaussians:
        """Return a copy in which the named columns hold `values` (each [K])."""
        table = self.table.copy()
        for name, column in values.items():
            table[name] = column
        return Gaussians(table, self.comments)

    def with_appearance(self, opacity_logits: Values, sh_coeffs: Values) -> Gaussians:
        """Return a copy with these logits [K] of opacity and colours [K,S,3], S as stored."""
        return self.with_columns({"opacity": opacity_logits} | _colour_columns(sh_coeffs))

    def with_comment(self, comment: str) -> Gaussians:
        """Return the same rows with one more comment line."""
        return Gaussians(self.table, (*self.comments, comment))

    def view(self, cameras: Sequence[Camera] = ()) -> gspure.View:
        """Return the model in 3-D, for a cell of a notebook; this layer knows the viewer by `gspure.view` only."""
        return gspure.view(self, cameras)

    @property
    def background(self) -> tuple[float, ...]:
        """The colour that the model was trained on, if a comment names it, else black."""
        shades = (_BACKGROUND.fullmatch(comment) for comment in self.comments)
        return next((tuple(map(float, shade.groups())) for shade in shades if shade), (0.0, 0.0, 0.0))

    @property
    def render_mode(self) -> str:
        """The render mode that comments name: mip (antialiased), 2dgs, or none; the last comment applies."""
        newest_first = (comment.strip().lower() for comment in reversed(self.comments))
        last = next(filter(_RENDER_MODE.fullmatch, newest_first), "")
        if last.endswith("2dgs"):
            return "2dgs"
        return "mip" if last.endswith(("mip", "1")) else ""

    def with_background(self, background: Sequence[float]) -> Gaussians:
        """Return the same rows with a comment that names the background, unless it is black or a comment names one."""
        if not any(background) or any(self.background):
            return self
        return self.with_comment("gspure background " + " ".join(f"{channel:.4f}" for channel in background))

    @staticmethod
    def from_parameters(*, scales: Values, opacities: Values, **parameters: Values) -> Gaussians:
        """Build a vanilla table like `from_stored`, from scales above 0 and opacities between 0 and 1."""
        return Gaussians.from_stored(log_scales=np.log(scales), opacity_logits=logit(opacities), **parameters)

    @staticmethod
    def from_gsplat(splats: Mapping[str, Any]) -> Gaussians:
        """Build a vanilla table from the parameters of gsplat: arrays, or tensors of PyTorch on any device.

        `splats` are those of ``simple_trainer``: ``means`` [K,3], ``quats`` [K,4] (w, x, y, z), ``scales`` [K,3] (log),
        ``opacities`` [K] (logit), ``sh0`` [K,1,3] and ``shN`` [K,S-1,3]; others are ignored. Raise `InputError` if one
        is missing or has another shape.
        """
        arrays = {name: _on_host(values) for name, values in splats.items()}
        count = len(arrays.get("means", ()))
        allowed: dict[str, list[tuple[int, ...]]] = {
            "means": [(count, 3)],
            "quats": [(count, 4)],
            "scales": [(count, 3)],
            "opacities": [(count,)],
            "sh0": [(count, 1, 3)],
            "shN": [(count, rest, 3) for rest in REST_COEFFICIENTS],
        }
        for name, shapes in allowed.items():
            if name not in arrays:
                raise InputError("splats", name, expected="an array", found=", ".join(arrays) or "nothing")
            shape = arrays[name].shape
            if shape not in shapes:
                raise InputError("splats", name, expected=" or ".join(map(str, shapes)), found=str(shape))
        return Gaussians.from_stored(
            means=arrays["means"],
            quats=arrays["quats"],
            log_scales=arrays["scales"],
            opacity_logits=arrays["opacities"],
            sh_coeffs=np.concatenate([arrays["sh0"], arrays["shN"]], axis=1),
        )

    def to_gsplat(self) -> dict[str, Float32]:
        """Return copies of the parameters by gsplat's names, as `from_gsplat` takes them."""
        parameters = {
            "means": self.means,
            "quats": self.quats,
            "scales": self.log_scales,
            "opacities": self.columns("opacity")[:, 0],
            "sh0": self.sh_coeffs[:, :1],
            "shN": self.sh_coeffs[:, 1:],
        }
        return {name: np.array(values) for name, values in parameters.items()}

    @staticmethod
    def from_stored(
        *, means: Values, quats: Values, log_scales: Values, opacity_logits: Values, sh_coeffs: Values
    ) -> Gaussians:
        """Build a vanilla table from parameters [K,...], with the shapes and units of the properties of the same names.

        `sh_coeffs` [K,S,3] have S = 1, 4, 9 or 16.
        """
        sh_coeffs = np.asarray(sh_coeffs)
        rest = 3 * (sh_coeffs.shape[1] - 1)
        rest_names = [f"f_rest_{i}" for i in range(rest)]
        names = ["x", "y", "z", *NORMALS, *COLOUR, *rest_names, "opacity", *SCALES, *ROTATION]
        table = np.zeros(len(means), dtype=[(name, "<f4") for name in names])
        stored = table.view("<f4").reshape(len(means), len(names))
        for start in range(0, len(means), _BLOCK_ROWS):
            rows = slice(start, start + _BLOCK_ROWS)
            colours = sh_coeffs[rows]
            stored[rows, :3] = means[rows]
            stored[rows, 6:9] = colours[:, 0]
            stored[rows, 9:-8] = colours[:, 1:].transpose(0, 2, 1).reshape(len(colours), rest)
            stored[rows, -8] = opacity_logits[rows]
            stored[rows, -7:-4] = log_scales[rows]
            stored[rows, -4:] = quats[rows]
        return Gaussians(table)


def _on_host(values: Any) -> Float32:
    """Return an array, or a tensor of PyTorch, as an array."""
    return np.asarray(values.detach().cpu() if hasattr(values, "detach") else values, np.float32)


def _colour_columns(sh_coeffs: Values) -> dict[str, Values]:
    """Return the columns of coefficients [K,S,3] by name, channel-major."""
    columns = dict(zip(COLOUR, sh_coeffs[:, 0].T, strict=True))
    rest = sh_coeffs[:, 1:].transpose(0, 2, 1).reshape(len(sh_coeffs), 3 * (sh_coeffs.shape[1] - 1))
    return columns | {f"f_rest_{i}": column for i, column in enumerate(rest.T)}


def sigmoid(logits: Float32) -> Float32:
    """Return 1 / (1 + exp(-x)), with full relative precision for very negative logits."""
    with np.errstate(over="ignore"):
        return np.float32(1) / (np.float32(1) + np.exp(-logits))


def logit(opacities: Any, least: float = 0.0) -> Float32:
    """Return log(α / (1 - α)) of opacities, clipped to `least` .. 1 - `least` first."""
    clipped = np.clip(np.asarray(opacities, np.float64), least, 1 - least)
    return np.asarray(np.log(clipped) - np.log1p(-clipped), np.float32)


def finite(stored: Float32) -> Float32:
    """Return logits or logarithms in which finite numbers of the same meaning replace infinities."""
    return np.asarray(np.nan_to_num(stored, nan=np.nan, posinf=CERTAIN, neginf=NOTHING))
