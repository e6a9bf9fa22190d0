"""GS-Hider's key: the decoder that reads the message from the feature map that everybody has."""

from copy import deepcopy
from pathlib import Path
from typing import Final, Self

import numpy as np

from gspure.cameras.camera import Camera
from gspure.errors import InputError
from gspure.model import Gaussians
from gspure.opencl.device import Device
from gspure.opencl.losses import Photographs
from gspure.public_model import Lesson, PublicModel, RenderView, Rows
from gspure.schemes.gs_hider.decoder_file import DecoderFile
from gspure.schemes.gs_hider.layout import MESSAGE_DECODER, decoder_name, find_decoder
from gspure.schemes.gs_hider.public_model import FeatureModel
from gspure.schemes.scheme import Key

FIT_RATE: Final = 1e-3  # first learning rate of `DecoderKey.fitted`: that of the training


class DecoderKey(Key):
    """The private decoder, of the message."""

    def __init__(self, decoder: DecoderFile) -> None:
        self.decoder = decoder

    @classmethod
    def read(cls, folder: Path) -> Self:
        """Read the newest key in a folder, or raise `InputError`."""
        file = find_decoder(folder, MESSAGE_DECODER)
        if file is None:
            raise InputError(folder, "key", expected=decoder_name("N", MESSAGE_DECODER), found="no such file")
        return cls(DecoderFile.read(file))

    def write(self, folder: Path) -> None:
        """Write the decoder."""
        self.decoder.write(folder)

    def message(self, public: PublicModel, extraction: str, device: Device | None = None) -> RenderView:  # noqa: ARG002
        """Return the renderer of the private decoder's image."""
        from gspure.schemes.gs_hider.decoder import decoded

        return decoded(_feature_map(public, device), self.decoder.network, self.decoder.source)

    def fitted(self, public: PublicModel, lesson: Lesson) -> Self:
        """Return the decoder after training on the model's feature maps; the model stays as it is."""
        from gspure.schemes.gs_hider.decoder import differentiated
        from gspure.training.pytorch import single_threaded, torch

        feature_map, decoder = _feature_map(public, lesson.device), deepcopy(self.decoder.network)
        photographs = Photographs(lesson.images, lesson.device)
        optimizer = torch.optim.Adam(decoder.parameters())
        with single_threaded():
            for view, factor in lesson.schedule():
                differentiated(decoder, feature_map(lesson.views[view]), photographs, view)
                optimizer.param_groups[0]["lr"] = factor * FIT_RATE
                optimizer.step()
        return type(self)(DecoderFile.of(decoder, 0, MESSAGE_DECODER))

    def gaussians(self, public: PublicModel, camera: Camera, extraction: str) -> tuple[Gaussians, Rows]:  # noqa: ARG002
        """Return the Gaussians of the scene, which are also those of the message."""
        return public.gaussians(camera)

    def wrong(self, rng: np.random.Generator) -> Self:
        """Return an untrained decoder."""
        from gspure.schemes.gs_hider.decoder import untrained

        (decoder,) = untrained(1, int(rng.integers(1 << 31)))
        return type(self)(DecoderFile.of(decoder, 0, MESSAGE_DECODER))


def _feature_map(public: PublicModel, device: Device | None) -> RenderView:
    """Return the renderer of a model's features."""
    if not isinstance(public, FeatureModel):
        raise InputError("model", "semantic_*", expected="the features of GS-Hider", found="none")
    return public.feature_map(device)
