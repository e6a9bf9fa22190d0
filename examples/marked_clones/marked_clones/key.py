"""The key: the bits, and the decoder that reads them from images.

::

    <key>/marked_clones.npz   the bits and the decoder's weights
    <key>/message_rows.npy    the clones: bool [K], true in the rows of the public model that carry the bits
"""

from __future__ import annotations

from pathlib import Path
from typing import Final

import numpy as np

from gspure.errors import InputError
from gspure.evaluation.collecting import MESSAGE_ROWS
from gspure.files import Bools, Float32, Kind, load_array, load_arrays, save_array, save_arrays
from gspure.model.finite import require_computed
from gspure.schemes.scheme import Key
from gspure.training.pytorch import single_threaded, torch
from marked_clones.decoder import Decoder, untrained

_FILE: Final = "marked_clones.npz"


class ClonesKey(Key):
    """The bits [N], the decoder that reads them, and the rows [K] that are clones."""

    def __init__(self, bits: Bools, decoder: Decoder, message_rows: Bools) -> None:
        self.bits = bits
        self.decoder = decoder
        self.message_rows = message_rows

    def read_bits(self, image: Float32) -> Bools:
        """Return the bits [N] that an image [H,W,3] shows."""
        with torch.inference_mode(), single_threaded():
            logits = self.decoder(torch.from_numpy(np.ascontiguousarray(image.transpose(2, 0, 1)))[None])
        require_computed(logits[0].numpy(), "key", _FILE)
        shown: Bools = logits[0].numpy() > 0
        return shown

    def wrong(self, rng: np.random.Generator) -> ClonesKey:
        """Return an untrained decoder and other bits."""
        decoder = untrained(len(self.bits), int(rng.integers(1 << 31)))
        return ClonesKey(rng.random(len(self.bits)) < 0.5, decoder, rng.permutation(self.message_rows))

    def write(self, folder: Path) -> None:
        """Write both files."""
        weights = {name: tensor.numpy() for name, tensor in self.decoder.state_dict().items()}
        save_arrays(folder / _FILE, {"bits": self.bits} | weights)
        save_array(folder / MESSAGE_ROWS, self.message_rows)

    @staticmethod
    def read(folder: Path) -> ClonesKey:
        """Read a key.

        Raise `InputError` if a file is missing or unreadable, or an array has another type or shape or is not finite.
        """
        path = Path(folder) / _FILE
        weights = untrained(1, 0).state_dict()
        kinds: dict[str, Kind] = {name: (np.float32, tuple(tensor.shape)) for name, tensor in weights.items()}
        kinds |= {
            "head.weight": (np.float32, (None, weights["head.weight"].shape[1])),
            "head.bias": (np.float32, (None,)),
        }
        arrays = load_arrays(path, {"bits": (np.bool_, (None,)), **kinds}, "a key of marked clones")
        bits = arrays.pop("bits")
        if not len(bits):
            raise InputError(path, "bits", expected="at least one", found="none")
        for name in ("head.weight", "head.bias"):
            if len(arrays[name]) != len(bits):
                raise InputError(path, name, expected=f"{len(bits)} rows, one per bit", found=str(len(arrays[name])))
        decoder = untrained(len(bits), 0)
        decoder.load_state_dict({name: torch.from_numpy(array) for name, array in arrays.items()})
        message_rows = load_array(Path(folder) / MESSAGE_ROWS, dtype=np.bool_, shape=(None,))
        return ClonesKey(bits, decoder, message_rows)
