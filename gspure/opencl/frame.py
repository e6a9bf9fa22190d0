"""The variants of a frame: which energy, how many channels, which accumulators."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, Literal, get_args

Energy = Literal["ewa", "ray"]
ENERGIES: Final[tuple[Energy, ...]] = get_args(Energy)


@dataclass(frozen=True)
class Pass:
    """What one traversal computes; every combination is a program of its own.

    Parameters
    ----------
    energy : "ewa" or "ray"
        2-D splat with dilation, or the Gaussian's maximum along the ray (paper, Eq. E).
    channels : int
        Channels blended per pixel; 0 for none.
    sh_degree : int
        0 to 3: the channels are colours from spherical harmonics; -1: they are stored features.
    contributions, median_depth : bool
        Which accumulators run along.
    stored_sh_degree : int, optional
        Degree of the stored coefficients, where it is higher than the one in use.
    points : bool
        Made for points in space, not for pixel centres (energy "ray").

    """

    energy: Energy
    channels: int = 0
    sh_degree: int = -1
    contributions: bool = False
    median_depth: bool = False
    stored_sh_degree: int | None = None
    points: bool = False

    @property
    def layout(self) -> dict[str, int]:
        """Definitions that fix the splat's layout (layout.cl)."""
        return {"RAY": int(self.energy == "ray"), "CHANNELS": self.channels, "POINTS": int(self.points)}

    @property
    def channel_attributes(self) -> int:
        """Numbers stored per Gaussian that its channels come from: SH coefficients, or the channels themselves."""
        if self.sh_degree < 0:
            return self.channels
        return 3 * (1 + (self.sh_degree if self.stored_sh_degree is None else self.stored_sh_degree)) ** 2

    @property
    def splat_floats(self) -> int:
        """Floats of one splat, and of its used part: as layout.cl computes them."""
        return -(-self.staged_floats // 16) * 16

    @property
    def staged_floats(self) -> int:
        """Floats of a splat that blending reads."""
        return (12 if self.energy == "ray" else 7) + self.channels
