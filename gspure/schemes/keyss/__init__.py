"""KeySS (Ren et al. 2025): with a key, a network turns the Gaussians of a vanilla model into those of the message.

Gaussians and network learn together. From the paper: the network, the weights of the losses (0.5 scene, 0.5 message,
0.01 wrong key) and AdamW. Ours: a wrong key should add nothing to the public rows; the message does not train public
opacities; the network's learning rate; training starts from points, with the densification of 3DGS, not from a trained
model of the scene. The key is a vector, and the network::

    <key>/keyss.npz     key [768], and weight_i and bias_i of the network
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Final

import numpy as np

from gspure.arrays import Float32, Kind, load_arrays, save_arrays
from gspure.constants import MAX_SH_DEGREE
from gspure.errors import InputError
from gspure.metrics.targets import ADAPTIVE, MESSAGE
from gspure.model import Gaussians
from gspure.model.finite import require_computed
from gspure.model.gaussians import finite
from gspure.opencl.device import Device, choose_device
from gspure.opencl.trainable import Parameters
from gspure.public_model import Lesson, PublicModel, Rows
from gspure.schemes.keyss.network import KEY, RATE, SHAPES, Network, added, gaussians_of, random_key
from gspure.schemes.pair import Pair
from gspure.schemes.rows import rows_of
from gspure.schemes.scheme import PYTORCH, Key, Run, Scheme
from gspure.settings import Amount, MaxGaussians, Range, Steps
from gspure.training.trainer import watched


def embed(
    pair: Pair,
    seed: int,
    device: Device | None = None,
    *,
    iterations: Steps = 3000,
    message_weight: Amount = 1.0,
    network_rate: Annotated[float, Range(1e-9, 1.0)] = RATE,
    max_gaussians: MaxGaussians = 30_000,
) -> tuple[PublicModel, NetworkKey | None]:
    """Hide the pair's message in its scene; a message weight of 0 gives the scene's clean model, and no key.

    `message_weight` is the weight of the message's loss (the scene's is 1), `network_rate` the network's initial
    learning rate, `max_gaussians` the limit of densification. Needs PyTorch.
    """
    begin = pair.initial_gaussians(max_gaussians, seed)
    from gspure.schemes.keyss.training import Training

    settings = Run(pair, iterations, message_weight, max_gaussians, seed, device or choose_device())
    run = Training(settings, begin, network_rate)
    for _ in watched(run, iterations, lambda: f"{len(run.rows)} Gaussians"):
        pass
    public = PublicModel(gaussians_of(run.rows.values))
    return public, NetworkKey(run.key, run.learner.network()) if message_weight else None


_FILE: Final = "keyss.npz"


@dataclass(frozen=True, eq=False)
class NetworkKey(Key):
    """The private part of the scheme: the vector [768] and the network."""

    vector: Float32
    network: Network

    @classmethod
    def read(cls, folder: Path) -> NetworkKey:
        """Read a key, or raise `InputError`."""
        kinds: dict[str, Kind] = {name: (np.float32, shape) for name, shape in ({"key": (KEY,)} | SHAPES).items()}
        content = load_arrays(Path(folder) / _FILE, kinds, "a key of KeySS")
        return cls(content.pop("key"), content)

    def write(self, folder: Path) -> None:
        """Write vector and network."""
        save_arrays(folder / _FILE, {"key": self.vector, **self.network})

    def fitted(self, public: PublicModel, lesson: Lesson) -> NetworkKey:
        """Return the key with its network trained on the model; the model stays as it is."""
        from gspure.schemes.keyss.training import Branch, Learner
        from gspure.training.pytorch import on_device, single_threaded

        rows, learner = on_device(_rows(public)), Learner(self.network)
        branch = Branch(lesson.views, lesson.images, lesson.device)
        with single_threaded():
            for view, factor in lesson.schedule():
                learner.differentiate(branch, rows, self.vector, view, 1.0)
                learner.step(factor * RATE)
        return replace(self, network=learner.network())

    def wrong(self, rng: np.random.Generator) -> NetworkKey:
        """Return the network with another random vector."""
        return replace(self, vector=random_key(rng))

    def revealed(self, public: PublicModel, extraction: str) -> tuple[Gaussians, Rows]:  # noqa: ARG002
        """Return the Gaussians that show the message, one per row."""
        rows = _rows(public)
        message = gaussians_of(rows + added(self.network, self.vector, rows))
        require_computed(message, "key", _FILE)
        return message, np.arange(len(rows))


def _rows(public: PublicModel) -> Float32:
    """Return the rows [K,59]; harmonics that the model lacks are zero."""
    if not public.visible or not public.rows_are_gaussians:
        raise InputError("keyss", "model", expected="vanilla 3DGS", found="a model of another kind")
    model = public.model
    geometry = (model.means, model.quats, finite(model.log_scales), finite(model.table["opacity"]))
    return rows_of(Parameters(*geometry, model.sh_coeffs_of(MAX_SH_DEGREE)))


READS = dict.fromkeys((MESSAGE, ADAPTIVE), ("x", "y", "z", "f_dc_*", "f_rest_*", "opacity", "scale_*", "rot_*"))

SCHEME = Scheme("keyss", embed, PublicModel.read, NetworkKey.read, READS, packages=PYTORCH, fits=True)
