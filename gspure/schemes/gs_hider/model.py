"""GS-Hider's public model, Gaussians with features and the decoder of the scene; its key, that of the message."""

from collections.abc import Callable, Mapping
from copy import deepcopy
from pathlib import Path
from typing import ClassVar, Final, Self

import numpy as np

from gspure.cameras.camera import Camera
from gspure.errors import InputError
from gspure.files import Float32
from gspure.model import Gaussians, model_file
from gspure.model.activations import sigmoid
from gspure.opencl.adam import adam_step
from gspure.opencl.device import Device
from gspure.opencl.frame import Energy
from gspure.opencl.losses import Photographs
from gspure.public_model import BLACK, Background, Columns, Lesson, PublicModel, RenderView, Rows
from gspure.renderer import Renderer
from gspure.schemes.gs_hider.files import (
    CHANNELS,
    FEATURES,
    MESSAGE_DECODER,
    SCENE_DECODER,
    DecoderFile,
    decoder_name,
    find_decoder,
    read_rows,
)
from gspure.schemes.scheme import Key


class FeatureModel(PublicModel):
    """Rows with 16 features each, the columns ``semantic_0..15``, and the public decoder.

    Without its decoder, a model can be attacked but not rendered.
    """

    attributes: ClassVar[Columns] = {
        **PublicModel.attributes,
        "colour": ("semantic_*",),
        "base_colour": ("semantic_*",),
    }

    rates: ClassVar[Mapping[str, float]] = {"colour": 5e-3}
    """Learning rate of the features, before the sigmoid. Ours."""

    def __init__(self, model: Gaussians, decoder: DecoderFile | None) -> None:
        super().__init__(model)
        self.decoder = decoder

    @classmethod
    def read(cls, path: Path) -> Self:
        """Read a model's .ply, or its folder, and the decoder beside it or in the authors' layout."""
        ply = model_file(Path(path))
        decoder = find_decoder(ply.parent, SCENE_DECODER)
        return cls(read_rows(ply), DecoderFile.read(decoder) if decoder else None)

    @property
    def network_name(self) -> str:
        """Name of the decoder's file; empty without one."""
        return self.decoder.source.name if self.decoder else ""

    def write_networks(self, folder: Path) -> None:
        """Write the decoder, if there is one."""
        if self.decoder:
            self.decoder.write(folder)

    def with_model(self, model: Gaussians) -> Self:
        """Return the same decoder with other rows."""
        return type(self)(model, self.decoder)

    @property
    def visible(self) -> bool:
        """Whether there is a decoder."""
        return self.decoder is not None

    def scene(self, device: Device | None = None, background: Background = BLACK, energy: Energy = "ewa") -> RenderView:
        """Return the renderer of the public decoder's image.

        Raise `InputError` if the decoder is missing or invalid, or PyTorch is not installed.
        """
        decoder = self._present_decoder()
        network = decoder.network
        from gspure.schemes.gs_hider.decoder import decoded

        return decoded(self.feature_map(device, background, energy), network, decoder.source)

    def learned(self, lesson: Lesson) -> Self:
        """Return the model with features learned through the public decoder; the decoder and all else stay."""
        decoder = self._present_decoder().network.requires_grad_(requires_grad=False)
        from gspure.schemes.gs_hider.decoder import differentiated
        from gspure.training.pytorch import single_threaded

        raw, renderer = self.model.columns(*FEATURES).copy(), Renderer(self.model, lesson.device)
        photographs = Photographs(lesson.images, lesson.device)
        first, second = np.zeros_like(raw), np.zeros_like(raw)
        rate, background = lesson.rates(self.rates).get("colour", 0.0), [lesson.background[0]] * CHANNELS
        with single_threaded():
            for number, (view, factor) in enumerate(lesson.schedule(), start=1):
                features = sigmoid(raw)
                feature_map, pull_back = renderer.vjp(lesson.views[view], features, background)
                _, gradient = differentiated(decoder, feature_map, photographs, view)
                gradient = pull_back(gradient).channels * features * (1 - features)
                adam_step(raw, first, second, gradient, factor * rate, number)
        return self.with_model(self.model.with_columns(dict(zip(FEATURES, raw.T, strict=True))))

    def _present_decoder(self) -> DecoderFile:
        if self.decoder is None:
            raise InputError("model", "decoder", expected=f"chkpntN_{SCENE_DECODER}.pth with the .ply", found="none")
        return self.decoder

    def feature_map(
        self, device: Device | None = None, background: Background = BLACK, energy: Energy = "ewa"
    ) -> Callable[[Camera], Float32]:
        """Return a function from a camera to its blended features [H,W,16].

        The first value of `background` is that of all channels, as in the authors' rasterizer.
        """
        renderer = Renderer(self.model, device, energy=energy)
        features = sigmoid(self.model.columns(*FEATURES))
        return lambda camera: renderer.feature_map(camera, features, [background[0]] * CHANNELS)


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
