"""The key: the bits, and the decoder that reads them from images.

::

    <key>/marked_clones.npz   the bits and the decoder's weights
    <key>/message_rows.npy    of Marked Clones: bool [K], true in the rows of the public model that carry the bits
"""

from __future__ import annotations

from pathlib import Path
from typing import Final

import numpy as np

from gspure.arrays import Bools, Float32, Kind, load_array, load_arrays, save_array, save_arrays
from gspure.errors import InputError
from gspure.model.finite import require_computed
from gspure.schemes.scheme import Key
from gspure_torch.pytorch import single_threaded, torch
from marked_clones.decoder import Decoder, untrained

_FILE: Final = "marked_clones.npz"
_ROWS: Final = "message_rows.npy"


class BitsKey(Key):
    """The bits [N], and the decoder that reads them."""

    def __init__(self, bits: Bools, decoder: Decoder) -> None:
        self.bits = bits
        self.decoder = decoder

    def read_bits(self, image: Float32) -> Bools:
        """Return the bits [N] that an image [H,W,3] shows."""
        with torch.inference_mode(), single_threaded():
            logits = self.decoder(torch.from_numpy(np.ascontiguousarray(image.transpose(2, 0, 1)))[None])
        require_computed(logits[0].numpy(), "key", _FILE)
        bits: Bools = logits[0].numpy() > 0
        return bits

    def wrong(self, rng: np.random.Generator) -> BitsKey:
        """Return an untrained decoder and other bits."""
        decoder = untrained(len(self.bits), int(rng.integers(1 << 31)))
        return BitsKey(rng.random(len(self.bits)) < 0.5, decoder)

    def write(self, folder: Path) -> None:
        """Write the bits and the decoder's weights."""
        weights = {name: tensor.numpy() for name, tensor in self.decoder.state_dict().items()}
        save_arrays(folder / _FILE, {"bits": self.bits} | weights)

    @staticmethod
    def read(folder: Path) -> BitsKey:
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
        return BitsKey(bits, decoder)


class ClonesKey(BitsKey):
    """The bits [N], the decoder that reads them, and the rows [K] that are clones."""

    def __init__(self, bits: Bools, decoder: Decoder, message_rows: Bools) -> None:
        super().__init__(bits, decoder)
        self.message_rows = message_rows

    def wrong(self, rng: np.random.Generator) -> ClonesKey:
        """Return an untrained decoder, other bits and other rows."""
        key = super().wrong(rng)
        return ClonesKey(key.bits, key.decoder, rng.permutation(self.message_rows))

    def write(self, folder: Path) -> None:
        """Write both files."""
        super().write(folder)
        save_array(folder / _ROWS, self.message_rows)

    @staticmethod
    def read(folder: Path) -> ClonesKey:
        """Read a key as `BitsKey.read` does, and its rows."""
        key = BitsKey.read(folder)
        return ClonesKey(key.bits, key.decoder, load_array(Path(folder) / _ROWS, dtype=np.bool_, shape=(None,)))
