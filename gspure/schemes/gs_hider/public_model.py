"""GS-Hider's public model: Gaussians with features, and the decoder that reads the scene from their blend."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from gspure.artifacts import filling
from gspure.cameras.camera import Camera
from gspure.errors import InputError
from gspure.model import Gaussians, write_model
from gspure.model.activations import sigmoid
from gspure.model.inria import point_cloud
from gspure.opencl.device import Device
from gspure.opencl.frame import Energy
from gspure.public_model import BLACK, Background, Columns, PublicModel, RenderView
from gspure.renderer import Renderer
from gspure.schemes.gs_hider.decoder_file import DecoderFile
from gspure.schemes.gs_hider.layout import CHANNELS, FEATURES, SCENE, find_decoder, read_rows

Float32 = NDArray[np.float32]


class FeatureModel(PublicModel):
    """Rows with 16 features each, and the public decoder.

    Parameters
    ----------
    model : Gaussians
        With the columns ``semantic_0..15``.
    decoder : DecoderFile, optional
        Of the scene; without it the model can be attacked, not looked at.

    """

    attributes: ClassVar[Columns] = {
        **PublicModel.attributes,
        "colour": ("semantic_*",),
        "base_colour": ("semantic_*",),
    }

    def __init__(self, model: Gaussians, decoder: DecoderFile | None) -> None:
        super().__init__(model)
        self.decoder = decoder

    @classmethod
    def read(cls, path: Path) -> Self:
        """Read a model's .ply, or the folder that holds it; the decoder lies beside it, or where the authors put it."""
        path = Path(path)
        ply = point_cloud(path) if path.is_dir() else path
        decoder = find_decoder(ply.parent, SCENE)
        return cls(read_rows(ply), DecoderFile.read(decoder) if decoder else None)

    def write(self, path: Path) -> None:
        """Write the .ply, and the decoder beside it."""
        path = Path(path)
        with filling(path.parent) as folder:
            write_model(folder / path.name, self.model)
            if self.decoder:
                self.decoder.write(folder)

    def with_model(self, model: Gaussians) -> Self:
        """Return other rows with the same decoder."""
        return type(self)(model, self.decoder)

    @property
    def visible(self) -> bool:
        """Whether the decoder is there."""
        return self.decoder is not None

    def scene(self, device: Device | None = None, background: Background = BLACK, energy: Energy = "ewa") -> RenderView:
        """Return what the public decoder reads from the feature map.

        Raises
        ------
        InputError
            There is no decoder, it cannot be used, or PyTorch is missing.

        """
        if self.decoder is None:
            raise InputError("model", "decoder", expected=f"chkpntN_{SCENE}.pth with the .ply", found="none")
        from gspure.schemes.gs_hider.decoder import decoded

        return decoded(self.feature_map(device, background, energy), self.decoder.network)

    def feature_map(
        self, device: Device | None = None, background: Background = BLACK, energy: Energy = "ewa"
    ) -> Callable[[Camera], Float32]:
        """Return what gives, for a camera, the blended features [H,W,16].

        All of them have the background's first value behind them, as in the authors' rasterizer.
        """
        renderer = Renderer(self.model, device, energy=energy)
        features = sigmoid(self.model.columns(*FEATURES))
        return lambda camera: renderer.feature_map(camera, features, [background[0]] * CHANNELS)
