"""A frame: the outputs of its traversal, and the data that its steps share."""

from dataclasses import dataclass

import pyopencl as cl

from gspure.cameras.camera import Camera
from gspure.constants import TILE, Energy
from gspure.opencl.engine import Engine, Program
from gspure.opencl.storage import Storage


@dataclass(frozen=True)
class Traversal:
    """The outputs of one traversal of the tile lists; every combination is a separate program."""

    energy: Energy  # 2-D splat with dilation, or the Gaussian's maximum along the ray (paper, Eq. E)
    channels: int = 0  # blended per pixel; 0 for none
    sh_degree: int = -1
    """0 to 3: colours of spherical harmonics, and 1 / depth and 1 if channels are 4 or 5; -1: stored features"""

    contributions: bool = False
    median_depth: bool = False  # pixels end at it, so that their transmittance is not final
    stored_sh_degree: int | None = None  # of the stored coefficients, if higher than sh_degree
    points: bool = False  # for points in space instead of pixel centres (energy "ray")

    @property
    def defines(self) -> dict[str, int]:
        """Definitions of the layout of splats (layout.cl) and of footprints."""
        return {"RAY": int(self.energy != "ewa"), "CHANNELS": self.channels, "POINTS": int(self.points)}

    @property
    def channel_attributes(self) -> int:
        """Numbers stored per Gaussian for its channels: SH coefficients, or the channels themselves."""
        if self.sh_degree < 0:
            return self.channels
        stored_sh_degree = self.sh_degree if self.stored_sh_degree is None else self.stored_sh_degree
        return 3 * (1 + stored_sh_degree) ** 2

    @property
    def splat_floats(self) -> int:
        """Floats of a splat, with padding: SPLAT in layout.cl."""
        return -(-self.staged_floats // 16) * 16

    @property
    def staged_floats(self) -> int:
        """Floats of a splat that blending reads: SPLAT_CHANNELS + CHANNELS in layout.cl."""
        return (7 if self.energy == "ewa" else 12) + self.channels


@dataclass(frozen=True)
class Frame:
    """One view of a model on an engine.

    `storage` holds the model's geometry. `channels` are SH coefficients or features (see `traversal`) in its order.
    """

    engine: Engine
    storage: Storage
    camera: Camera
    traversal: Traversal
    channels: cl.Buffer | None = None

    @property
    def tiles(self) -> tuple[int, int]:
        """Columns and rows of tiles."""
        return -(-self.camera.width // TILE), -(-self.camera.height // TILE)

    @property
    def size(self) -> tuple[int, int]:
        """Width and height in pixels."""
        return self.camera.width, self.camera.height

    def program(self, *sources: str, **defines: int) -> Program:
        """Return the program of these sources, built for the frame's traversal."""
        return self.engine.program(*sources, **self.traversal.defines, **defines)
