"""GS-Hider's public model: Gaussians with features, and the decoder of the scene. The files of decoders.

The files are those of its authors' code::

    point_cloud.ply         x y z nx ny nz opacity scale_0..2 rot_0..3 semantic_0..15; features before their sigmoid
    chkpntN_net.pth         state dict of the public scene decoder, N the iteration
    chkpntN_waternet.pth    state dict of the private message decoder

Their code stores the model in ``point_cloud/iteration_N/`` and the decoders in the run's folder. Here, all public files
are in one folder and the private decoder in another. Both layouts are read.
"""

from __future__ import annotations

import io
import re
from collections.abc import Mapping
from copy import deepcopy
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Final, Self

import numpy as np
from numpy.typing import NDArray

from gspure.arrays import Float32, Float64
from gspure.cameras.camera import Camera
from gspure.constants import Energy
from gspure.errors import InputError, reading
from gspure.files import replacing
from gspure.model import Gaussians, model_file, read_model
from gspure.model.finite import require_computed
from gspure.model.gaussians import CORE, NORMALS, logit, sigmoid
from gspure.opencl.adam import adam_step
from gspure.opencl.device import Device
from gspure.opencl.losses import Photographs
from gspure.public_model import Background, Columns, Lesson, PublicModel, RenderView
from gspure.renderer import BLACK, Renderer

if TYPE_CHECKING:
    from gspure_torch.gs_hider.decoder import Decoder

CHANNELS: Final = 16
FEATURES: Final = tuple(f"semantic_{i}" for i in range(CHANNELS))
COLUMNS: Final = ("x", "y", "z", *NORMALS, *CORE[3:], *FEATURES)
ROLES: Final = ("net", "waternet")  # suffixes of the files' names: of the scene's decoder, and of the message's
SCENE_DECODER, MESSAGE_DECODER = ROLES
MIXED: Final = 0.25  # share of random means in `FeatureModel.mixed`; at 1 the mix may be singular; ours
LEAST_FEATURE: Final = 1e-9  # changed features are clipped to this .. 1 - this, so that their logits are finite


def decoder_name(iteration: int | str, role: str) -> str:
    """Return the name of a decoder's file."""
    return f"chkpnt{iteration}_{role}.pth"


def find_decoder(folder: Path, role: str) -> Path | None:
    """Return the newest decoder in a folder, or ``<model>/chkpntN_net.pth`` for ``<model>/point_cloud/iteration_N``."""
    folder = Path(folder).resolve()
    numbered = re.compile(decoder_name("([0-9]+)", role))
    files: dict[int, Path] = {}
    for file in folder.glob(decoder_name("*", role)):
        match = numbered.fullmatch(file.name)
        if match:
            files[int(match[1])] = file
    if files:
        return files[max(files)]
    file = folder.parents[1] / decoder_name(folder.name.removeprefix("iteration_"), role)
    return file if folder.parent.name == "point_cloud" and file.is_file() else None


@dataclass(frozen=True)
class DecoderFile:
    """A PyTorch state dict as stored, under its name: attacks read and write models without PyTorch."""

    source: Path
    content: bytes

    @staticmethod
    def read(path: Path) -> DecoderFile:
        """Read a file; `network` checks its content."""
        with reading(path, "a decoder's state dict"):
            return DecoderFile(path, path.read_bytes())

    @staticmethod
    def from_network(decoder: Decoder, iteration: int, role: str) -> DecoderFile:
        """Return the file of a decoder; the same weights give the same bytes."""
        from gspure_torch.pytorch import torch

        stream = io.BytesIO()
        torch.save({name: tensor.cpu().contiguous() for name, tensor in decoder.state_dict().items()}, stream)
        return DecoderFile(Path(decoder_name(iteration, role)), stream.getvalue())

    def write(self, folder: Path) -> None:
        """Write it, whole or not at all."""
        with replacing(Path(folder) / self.source.name) as temporary:
            temporary.write_bytes(self.content)

    @cached_property
    def network(self) -> Decoder:
        """The decoder, or `InputError` if the file is no finite state dict of it; code in the file is not executed."""
        from gspure_torch.gs_hider.decoder import Decoder
        from gspure_torch.pytorch import DEVICE, read_tensors, torch

        decoder = Decoder()
        state = read_tensors(self.source, self.content)
        expected_types = {name: f"float32 {list(tensor.shape)}" for name, tensor in decoder.state_dict().items()}
        types = {name: f"{tensor.dtype} {list(tensor.shape)}".removeprefix("torch.") for name, tensor in state.items()}
        for name in sorted(expected_types.keys() | types.keys()):
            expected = expected_types.get(name, "no such tensor")
            actual = types.get(name, "no such tensor")
            if actual != expected or not torch.isfinite(state[name]).all():
                hint = "decoders of forks, with batch normalization or channel attention, are not read"
                raise InputError(self.source, name[:80], expected=f"{expected}, finite", found=actual, hint=hint)
        decoder.load_state_dict({name: tensor.to(DEVICE) for name, tensor in state.items()})
        return decoder

    def unmixed(self, mixing: Float64) -> DecoderFile:
        """Return the decoder that shows the same image if `mixing` [16,16] is applied to the features of a pixel."""
        from gspure_torch.pytorch import on_device, on_host, torch

        decoder = deepcopy(self.network)
        weight = decoder.conv1.weight
        mixed_weight = np.einsum("ochw,cd->odhw", on_host(weight.detach()).astype(np.float64), np.linalg.inv(mixing))
        with torch.no_grad():
            weight.copy_(on_device(mixed_weight.astype(np.float32)))
        return replace(DecoderFile.from_network(decoder, 0, SCENE_DECODER), source=self.source)

    def image_of(self, feature_map: RenderView) -> RenderView:
        """Return the renderer of the image that the `network` computes from a feature map."""
        network = self.network
        from gspure_torch.pytorch import on_device, on_host, torch

        def image(camera: Camera) -> Float32:
            with torch.inference_mode():
                pixels: Float32 = on_host(network(on_device(feature_map(camera))).contiguous())
            require_computed(pixels, self.source, "image")
            return pixels

        return image


class FeatureModel(PublicModel):
    """Rows with 16 features each, and the public decoder; without it, a model can be attacked but not rendered."""

    attributes: ClassVar[Columns] = {
        **PublicModel.attributes,
        **dict.fromkeys(("colour", "base_colour"), ("semantic_*",)),
    }
    rates: ClassVar[Mapping[str, float]] = {"colour": 5e-3}  # of the features, before the sigmoid; ours

    def __init__(self, model: Gaussians, decoder: DecoderFile | None) -> None:
        super().__init__(model)
        self.decoder = decoder

    @classmethod
    def read(cls, path: Path) -> Self:
        """Read a model's .ply, or its folder, and the decoder beside it or in the authors' layout."""
        ply = model_file(Path(path))
        model = read_model(ply)
        decoder = find_decoder(ply.parent, SCENE_DECODER)
        channels = len(model.columns_named("semantic_"))
        if channels != CHANNELS:
            raise InputError(ply, "semantic_*", expected=f"{CHANNELS} properties", found=f"{channels} properties")
        return cls(model, DecoderFile.read(decoder) if decoder else None)

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
    def features(self) -> Float32:
        """The features [K,16] that are blended, 0 to 1."""
        return sigmoid(self.model.columns(*FEATURES))

    def with_features(self, features: NDArray[Any]) -> Self:
        """Return the same decoder with other features."""
        raw = logit(features, LEAST_FEATURE)
        return self.with_model(self.model.with_columns(dict(zip(FEATURES, raw.T, strict=True))))

    def mixed(self, rng: np.random.Generator) -> Self:
        """Return a model with weighted means of the features, in another order, and the decoder that undoes them.

        Means stay between 0 and 1, as the sigmoid demands, and leave a background that is the same for all features.
        Each becomes a channel whose old features it correlates with least.
        """
        if self.decoder is None:
            return self
        from scipy.optimize import linear_sum_assignment

        features = self.features.astype(np.float64)
        means = (1 - MIXED) * np.eye(CHANNELS) + MIXED * rng.dirichlet(np.ones(CHANNELS), CHANNELS)
        with np.errstate(invalid="ignore"):  # constant features correlate with nothing
            correlations = np.corrcoef(features.T, means @ features.T)[:CHANNELS, CHANNELS:]
        _, order = linear_sum_assignment(np.abs(np.nan_to_num(correlations)))
        mixing = means[order]
        return type(self)(self.with_features(features @ mixing.T).model, self.decoder.unmixed(mixing))

    @property
    def visible(self) -> bool:
        """Whether there is a decoder."""
        return self.decoder is not None

    def scene(self, device: Device | None = None, background: Background = BLACK, energy: Energy = "ewa") -> RenderView:
        """Return the renderer of the public decoder's image, or raise `InputError` without decoder or PyTorch."""
        return self._present_decoder().image_of(self.feature_map(device, background, energy))

    def learned(self, lesson: Lesson) -> Self:
        """Return the model with features learned through the public decoder; the decoder and all else stay."""
        decoder = self._present_decoder().network.requires_grad_(requires_grad=False)
        from gspure_torch.gs_hider.decoder import differentiated
        from gspure_torch.pytorch import single_threaded

        raw = self.model.columns(*FEATURES).copy()
        first = np.zeros_like(raw)
        second = np.zeros_like(raw)
        renderer = Renderer(self.model, lesson.device)
        photographs = Photographs(lesson.images, lesson.device)
        rate = lesson.rates(self.rates).get("colour", 0.0)
        background = _feature_background(lesson.background)
        with single_threaded():
            for number, (view, factor) in enumerate(lesson.schedule(), start=1):
                features = sigmoid(raw)
                feature_map, pull_back = renderer.vjp(lesson.views[view], features, background)
                _, gradient = differentiated(feature_map, view, decoder, photographs)
                gradient = pull_back(gradient).channels * features * (1 - features)
                adam_step(raw, first, second, gradient, factor * rate, number)
        return self.with_model(self.model.with_columns(dict(zip(FEATURES, raw.T, strict=True))))

    def _present_decoder(self) -> DecoderFile:
        if self.decoder is None:
            raise InputError("model", "decoder", expected=f"chkpntN_{SCENE_DECODER}.pth with the .ply", found="none")
        return self.decoder

    def feature_map(
        self, device: Device | None = None, background: Background = BLACK, energy: Energy = "ewa"
    ) -> RenderView:
        """Return the renderer of the features [H,W,16], on the first value of `background` as in the authors' code."""
        renderer = self.renderer(device, energy)
        features = self.features
        return lambda camera: renderer.feature_map(camera, features, _feature_background(background))


def _feature_background(background: Background) -> list[float]:
    """Return a background for all channels: the first value of a background of images."""
    return [background[0] for _ in range(CHANNELS)]
