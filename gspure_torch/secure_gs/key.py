"""SecureGS's key: private networks, perhaps with rows of the published model (`gspure_torch.reference`).

::

    <key>/securegs_hidden.npz       {offset,opacity,cov,color}.{0,2}.{weight,bias}
"""

from __future__ import annotations

from pathlib import Path
from typing import Final, Self

import numpy as np

from gspure.cameras.camera import Camera
from gspure.errors import InputError
from gspure.model import Gaussians
from gspure.opencl.device import Device, choose_device
from gspure.public_model import Lesson, PublicModel, RenderView, Rows
from gspure.renderer import Renderer
from gspure.schemes.scheme import Key
from gspure_torch.reference import NO_REFERENCE, Reference
from gspure_torch.secure_gs.anchors import PRIVATE, Networks, fresh, sizes_of
from gspure_torch.secure_gs.model import AnchorModel, read_networks, write_networks

HIDDEN: Final = "securegs_hidden.npz"
FIT_RATE: Final = 2e-3  # first learning rate of `HiddenKey.fitted`; ours


class HiddenKey(Key):
    """The private networks: ``offset``, ``opacity``, ``cov`` and ``color``."""

    def __init__(self, networks: Networks, reference: Reference = NO_REFERENCE) -> None:
        self.networks = networks
        self._reference = reference

    @classmethod
    def read(cls, folder: Path) -> Self:
        """Read a key."""
        networks = read_networks(Path(folder) / HIDDEN, PRIVATE, "the private networks of SecureGS")
        return cls(networks, Reference.read(Path(folder)))

    def write(self, folder: Path) -> None:
        """Write the networks and the rows."""
        write_networks(Path(folder) / HIDDEN, self.networks)
        self._reference.write(Path(folder))

    def message(self, public: PublicModel, extraction: str, device: Device | None = None) -> RenderView:
        """Return the renderer of the private networks' Gaussians."""
        device = device or choose_device()
        return lambda camera: Renderer(self.gaussians(public, camera, extraction)[0], device).image(camera)

    def gaussians(self, public: PublicModel, camera: Camera, extraction: str) -> tuple[Gaussians, Rows]:  # noqa: ARG002
        """Return the hidden Gaussians of a camera, and the anchor of each."""
        return self._readable(public).gaussians(camera, self.networks)

    def fitted(self, public: PublicModel, lesson: Lesson) -> Self:
        """Return the private networks after training on the model's anchors; the model stays as it is."""
        rates = dict.fromkeys(self.networks, FIT_RATE)
        networks = self._readable(public).trained(lesson, self.networks, rates).networks(0)
        return type(self)(networks, self._reference)

    def wrong(self, rng: np.random.Generator) -> Self:
        """Return untrained networks."""
        return type(self)(fresh(PRIVATE, *sizes_of(self.networks), rng), self._reference)

    def _readable(self, public: PublicModel) -> AnchorModel:
        """Return the model if the networks fit its anchors, or raise `InputError`."""
        if not isinstance(public, AnchorModel):
            raise InputError("secure_gs", "model", expected="anchors", found="Gaussians")
        feat_dim, k = sizes_of(self.networks)
        anchors = public.anchors
        if (anchors.feat_dim, anchors.k) != (feat_dim, k):
            expected = f"{feat_dim} features and {k} Gaussians per anchor"
            actual = f"{anchors.feat_dim} features and {anchors.k} Gaussians per anchor"
            raise InputError("secure_gs", "model", expected=expected, found=actual, hint="a key of another model")
        return self._reference.read_through(public)
