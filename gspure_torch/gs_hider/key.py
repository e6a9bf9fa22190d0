"""GS-Hider's key: the private decoder, perhaps with rows of the published model (`gspure_torch.reference`)."""

from __future__ import annotations

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
from gspure.schemes.scheme import Key
from gspure_torch.gs_hider.model import MESSAGE_DECODER, DecoderFile, FeatureModel, decoder_name, find_decoder
from gspure_torch.reference import NO_REFERENCE, Reference

FIT_RATE: Final = 1e-3  # first learning rate of `DecoderKey.fitted`: that of the training


class DecoderKey(Key):
    """The private decoder, of the message."""

    def __init__(self, decoder: DecoderFile, reference: Reference = NO_REFERENCE) -> None:
        self.decoder = decoder
        self._reference = reference

    @classmethod
    def read(cls, folder: Path) -> Self:
        """Read the newest key in a folder, or raise `InputError`."""
        file = find_decoder(folder, MESSAGE_DECODER)
        if file is None:
            raise InputError(folder, "key", expected=decoder_name("N", MESSAGE_DECODER), found="no such file")
        return cls(DecoderFile.read(file), Reference.read(folder))

    def write(self, folder: Path) -> None:
        """Write the decoder and the rows."""
        self.decoder.write(folder)
        self._reference.write(folder)

    def message(self, public: PublicModel, extraction: str, device: Device | None = None) -> RenderView:  # noqa: ARG002
        """Return the renderer of the private decoder's image."""
        return self.decoder.image_of(self._feature_map(public, device))

    def fitted(self, public: PublicModel, lesson: Lesson) -> Self:
        """Return the decoder after training on the model's feature maps; the model stays as it is."""
        from gspure_torch.gs_hider.decoder import differentiated
        from gspure_torch.pytorch import single_threaded, torch

        feature_map = self._feature_map(public, lesson.device)
        decoder = deepcopy(self.decoder.network)
        photographs = Photographs(lesson.images, lesson.device)
        optimizer = torch.optim.Adam(decoder.parameters())
        with single_threaded():
            for view, factor in lesson.schedule():
                differentiated(feature_map(lesson.views[view]), view, decoder, photographs)
                optimizer.param_groups[0]["lr"] = factor * FIT_RATE
                optimizer.step()
        return type(self)(DecoderFile.from_network(decoder, 0, MESSAGE_DECODER), self._reference)

    def gaussians(self, public: PublicModel, camera: Camera, extraction: str) -> tuple[Gaussians, Rows]:  # noqa: ARG002
        """Return the Gaussians of the scene, which are also those of the message."""
        return public.gaussians(camera)

    def wrong(self, rng: np.random.Generator) -> Self:
        """Return an untrained decoder."""
        from gspure_torch.gs_hider.decoder import untrained

        (decoder,) = untrained(1, int(rng.integers(1 << 31)))
        return type(self)(DecoderFile.from_network(decoder, 0, MESSAGE_DECODER), self._reference)

    def _feature_map(self, public: PublicModel, device: Device | None) -> RenderView:
        """Return the renderer of a model's features."""
        readable = self._reference.read_through(public)
        if not isinstance(readable, FeatureModel):
            raise InputError("model", "semantic_*", expected="the features of GS-Hider", found="none")
        return readable.feature_map(device)
