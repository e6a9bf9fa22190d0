"""KeySS's key: a vector and the network.

::

    <key>/keyss.npz               key [768], and weight_i and bias_i of the network
    <key>/keyss_canonical.npz     the same, of a network that reads rows in canonical frames
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

import numpy as np

from gspure.arrays import Float32, Kind, load_arrays, save_arrays
from gspure.constants import MAX_SH_DEGREE
from gspure.errors import InputError
from gspure.model import Gaussians
from gspure.model.finite import require_computed
from gspure.model.frames import canonical
from gspure.model.gaussians import finite
from gspure.opencl.trainable import Parameters
from gspure.public_model import Lesson, PublicModel, Rows
from gspure.schemes.scheme import Key
from gspure_torch.keyss.network import KEY, RATE, SHAPES, Network, added, gaussians_of, random_key
from gspure_torch.rows import rows_of

_FILE: Final = "keyss.npz"
_CANONICAL_FILE: Final = "keyss_canonical.npz"


@dataclass(frozen=True, eq=False)
class NetworkKey(Key):
    """The private part of the scheme: the vector [768] and the network.

    A canonical one reads rows in canonical frames (`gspure.model.frames`), so that no choice of frames affects it.
    """

    vector: Float32
    network: Network
    is_canonical: bool = False

    @classmethod
    def read(cls, folder: Path) -> NetworkKey:
        """Read a key, or raise `InputError`."""
        shapes = {"key": (KEY,), **SHAPES}
        kinds: dict[str, Kind] = {name: (np.float32, shape) for name, shape in shapes.items()}
        is_canonical = (Path(folder) / _CANONICAL_FILE).is_file()
        file = Path(folder) / (_CANONICAL_FILE if is_canonical else _FILE)
        content = load_arrays(file, kinds, "a key of KeySS")
        return cls(content.pop("key"), content, is_canonical)

    def write(self, folder: Path) -> None:
        """Write vector and network."""
        file = _CANONICAL_FILE if self.is_canonical else _FILE
        save_arrays(folder / file, {"key": self.vector, **self.network})

    def fitted(self, public: PublicModel, lesson: Lesson) -> NetworkKey:
        """Return the key with its network trained on the model; the model stays as it is."""
        from gspure_torch.keyss.training import Branch, Learner
        from gspure_torch.pytorch import on_device, single_threaded

        rows = on_device(self._rows(public))
        learner = Learner(self.network)
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
        rows = self._rows(public)
        message = gaussians_of(rows + added(self.network, self.vector, rows))
        require_computed(message, "key", _FILE)
        return message, np.arange(len(rows))

    def _rows(self, public: PublicModel) -> Float32:
        """Return the rows [K,59] as the network reads them; harmonics that the model lacks are zero."""
        if not public.visible or not public.rows_are_gaussians:
            raise InputError("keyss", "model", expected="vanilla 3DGS", found="a model of another kind")
        model = public.model
        quats = model.quats
        log_scales = finite(model.log_scales)
        if self.is_canonical:
            quats, log_scales = canonical(quats, log_scales)
        logits = finite(model.table["opacity"])
        return rows_of(Parameters(model.means, quats, log_scales, logits, model.sh_coeffs_of(MAX_SH_DEGREE)))
