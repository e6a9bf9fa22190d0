"""The key.

::

    <key>/splats_in_splats.npz   the key proper: mapping, positions of the message's Gaussians, shift
    <key>/hidden.ply             all Gaussians with their exact hidden attributes: not for `message`
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np

from gspure.arrays import Float32, Kind, load_arrays, save_arrays
from gspure.errors import InputError
from gspure.metrics.targets import ADAPTIVE, MESSAGE
from gspure.model import Gaussians, read_model, write_model
from gspure.model.finite import require_computed, require_finite
from gspure.model.gaussians import CORE, LEAST_OPACITY, logit
from gspure.opencl.trainable import Parameters
from gspure.public_model import Lesson, PublicModel, Rows
from gspure.schemes.matching import adaptive_matches, exact_matches
from gspure.schemes.scheme import Key
from gspure.schemes.splats_in_splats import bits
from gspure.schemes.splats_in_splats.opacity_mapping import OpacityMapping
from gspure.schemes.splats_in_splats.refining import refined
from gspure.settings import Range
from gspure.training.output import as_gaussians

_FILE: Final = "splats_in_splats.npz"
_HIDDEN: Final = "hidden.ply"


@dataclass(frozen=True, eq=False)
class SplatsInSplatsKey(Key):
    """The private part of the scheme."""

    positions: Float32  # [I,3], the centres of the message's Gaussians, along a space-filling curve
    mapping: OpacityMapping  # from their public opacities, in this order, to their hidden ones
    shift: int  # k of `gspure.schemes.splats_in_splats.bits`
    hidden: Gaussians  # all, with their hidden opacity and colour

    def revealed(self, public: PublicModel, extraction: str) -> tuple[Gaussians, Rows]:
        """Return the Gaussians that show the message, and the row of each.

        ``message`` reads the model as the scheme does: colours from the bits and opacities from the mapping, for the
        Gaussians of the key. ``message_adaptive`` gives each Gaussian that survived, even if it moved, its exact hidden
        colour and opacity. Both use the geometry of the model.
        """
        if extraction == ADAPTIVE:
            places = adaptive_matches(self.hidden, public.model)
        else:
            places = exact_matches(self.positions, public.model.means)
        rows = np.flatnonzero(places >= 0)
        survivors = public.model[rows]
        places = places[rows]
        if extraction == MESSAGE:
            sequence = np.zeros(len(self.positions), np.float32)  # the mapping reads opacity 0 where a row is missing
            sequence[places] = survivors.opacities
            opacity_logits = logit(self.mapping(sequence)[places], LEAST_OPACITY)
            sh_coeffs = bits.extract(survivors.sh_coeffs_of(self.hidden.sh_degree), self.shift)
        else:
            opacity_logits = self.hidden.table["opacity"][places]
            sh_coeffs = self.hidden.sh_coeffs[places]
        message = Gaussians(np.zeros(len(rows), self.hidden.table.dtype))
        message = message.with_columns({name: survivors.table[name] for name in CORE})
        message = message.with_appearance(opacity_logits, sh_coeffs)
        require_computed(message, "key", _FILE)
        return message, rows

    def forged(self, public: PublicModel, lesson: Lesson) -> SplatsInSplatsKey:
        """Return a key to the rows of a stranger's model, whose hidden colours learned the lesson."""
        model = public.model
        colours = np.zeros_like(model.sh_coeffs)
        begin = Parameters(model.means, model.quats, model.log_scales, model.table["opacity"], colours)
        hidden = as_gaussians(refined(begin, lesson))
        return SplatsInSplatsKey(model.means, OpacityMapping.fresh(lesson.rng), self.shift, hidden)

    def wrong(self, rng: np.random.Generator) -> SplatsInSplatsKey:
        """Return an untrained mapping and as many random Gaussians, with shuffled hidden attributes."""
        chosen = np.sort(rng.choice(len(self.hidden), len(self.positions), replace=False))
        order = rng.permutation(len(self.hidden))
        shuffled = self.hidden.with_appearance(self.hidden.table["opacity"][order], self.hidden.sh_coeffs[order])
        return SplatsInSplatsKey(self.hidden.means[chosen], OpacityMapping.fresh(rng), self.shift, shuffled)

    def write(self, folder: Path) -> None:
        """Write both files."""
        arrays = {"positions": self.positions, "shift": np.array(self.shift)}
        save_arrays(folder / _FILE, arrays | self.mapping.arrays)
        write_model(folder / _HIDDEN, self.hidden)

    @staticmethod
    def read(folder: Path) -> SplatsInSplatsKey:
        """Read a key, or raise `InputError`."""
        path = Path(folder) / _FILE
        hidden_path = Path(folder) / _HIDDEN
        layers = OpacityMapping.fresh(np.random.default_rng(0)).arrays
        kinds: dict[str, Kind] = {name: (np.float32, layer.shape) for name, layer in layers.items()}
        kinds |= {"positions": (np.float32, (None, 3)), "shift": (np.integer, ())}
        arrays = load_arrays(path, kinds, "a key of Splats in Splats")
        shift = int(arrays["shift"])
        Range(*bits.SHIFT_RANGE).require(path, "shift", shift)
        hidden = read_model(hidden_path)
        require_finite(hidden, hidden_path)
        if hidden.sh_degree < 0:
            raise InputError(hidden_path, "columns", expected="f_dc_0 to f_dc_2", found="no colours")
        return SplatsInSplatsKey(arrays["positions"], OpacityMapping.from_arrays(arrays), shift, hidden)
