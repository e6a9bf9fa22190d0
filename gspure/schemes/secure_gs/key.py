"""SecureGS's key: networks that compute other Gaussians from the public anchors."""

from pathlib import Path
from typing import Final, Self

import numpy as np

from gspure.cameras.camera import Camera
from gspure.errors import InputError
from gspure.model import Gaussians
from gspure.model.finite import require_computed
from gspure.opencl.device import Device, choose_device
from gspure.public_model import Lesson, PublicModel, RenderView, Rows
from gspure.renderer import Renderer
from gspure.schemes.scheme import Key
from gspure.schemes.secure_gs.files import BANK, HIDDEN, PRIVATE, read_hidden, write_hidden
from gspure.schemes.secure_gs.networks import Networks, fresh, require_networks
from gspure.schemes.secure_gs.neural import as_gaussians
from gspure.schemes.secure_gs.public_model import AnchorModel

FIT_RATE: Final = 2e-3  # first learning rate of `HiddenKey.fitted`; ours


class HiddenKey(Key):
    """The private networks: ``offset``, ``opacity``, ``cov`` and ``color``."""

    def __init__(self, networks: Networks) -> None:
        self.networks = networks

    @property
    def feat_dim(self) -> int:
        """Length of the features, which is also the width of the hidden layer."""
        return int(self.networks["opacity"]["0.bias"].size)

    @property
    def k(self) -> int:
        """Gaussians per anchor."""
        return int(self.networks["opacity"]["2.bias"].size)

    @classmethod
    def read(cls, folder: Path) -> Self:
        """Read a key."""
        key = cls(read_hidden(folder))
        require_networks(Path(folder) / HIDDEN, key.networks, key.feat_dim, key.k)
        return key

    def write(self, folder: Path) -> None:
        """Write the networks."""
        write_hidden(folder, self.networks)

    def message(self, public: PublicModel, extraction: str, device: Device | None = None) -> RenderView:
        """Return the renderer of the private networks' Gaussians."""
        device = device or choose_device()
        return lambda camera: Renderer(self.gaussians(public, camera, extraction)[0], device).image(camera)

    def gaussians(self, public: PublicModel, camera: Camera, extraction: str) -> tuple[Gaussians, Rows]:  # noqa: ARG002
        """Return the hidden Gaussians of a camera, and the anchor of each."""
        anchors = self._fitting(public)
        gaussians, rows = as_gaussians(*anchors.neural(camera, self._with_bank(anchors)), self.k)
        require_computed(gaussians, "key", HIDDEN)
        return gaussians, rows

    def fitted(self, public: PublicModel, lesson: Lesson) -> Self:
        """Return the private networks after training on the model's anchors; the model stays as it is."""
        anchors = self._fitting(public)
        learner = anchors.trained(lesson, self._with_bank(anchors), dict.fromkeys(self.networks, FIT_RATE))
        return type(self)({name: network for name, network in learner.networks(0).items() if name != BANK})

    def _fitting(self, public: PublicModel) -> AnchorModel:
        """Return a model whose anchors the networks can read."""
        if not isinstance(public, AnchorModel):
            raise InputError("secure_gs", "model", expected="anchors", found="Gaussians")
        if (public.anchors.feat_dim, public.anchors.k) != (self.feat_dim, self.k):
            expected = f"{self.feat_dim} features and {self.k} Gaussians per anchor"
            found = f"{public.anchors.feat_dim} and {public.anchors.k}"
            raise InputError("secure_gs", "model", expected=expected, found=found, hint="a key of another model")
        return public

    def _with_bank(self, public: AnchorModel) -> Networks:
        """Return the private networks, with the public one that blends features."""
        return {**self.networks, **{name: network for name, network in public.networks.items() if name == BANK}}

    def wrong(self, rng: np.random.Generator) -> Self:
        """Return untrained networks."""
        return type(self)(fresh(PRIVATE, self.feat_dim, self.k, rng))
