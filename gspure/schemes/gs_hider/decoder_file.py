"""The file of a decoder: copied byte for byte, parsed only when an image is rendered."""

from __future__ import annotations

import io
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Final

import numpy as np

from gspure.artifacts import replacing, verify
from gspure.errors import InputError, reading
from gspure.schemes.gs_hider.layout import decoder_name
from gspure.schemes.tensors import Tensor, read_tensors

if TYPE_CHECKING:
    from gspure.schemes.gs_hider.decoder import Decoder

LARGEST: Final = 16 << 20  # largest file in bytes; a decoder has half a megabyte

_CONTENT: Final = "a decoder's state dict"
_FORK: Final = "a fork's decoder, with batch normalization or channel attention; GS-Hider's own has neither"


@dataclass(frozen=True)
class DecoderFile:
    """A PyTorch state dict as stored: attacks read and write models without PyTorch.

    The name of its `source`, ``chkpntN_net.pth`` or ``chkpntN_waternet.pth``, is kept.
    """

    source: Path
    content: bytes

    @staticmethod
    def read(path: Path) -> DecoderFile:
        """Read a file of at most `LARGEST` bytes; `network` checks its content."""
        verify(path)
        with reading(path, _CONTENT):
            size = path.stat().st_size
            if size > LARGEST:
                raise InputError(path, "file", expected=f"{_CONTENT}, at most {LARGEST} bytes", found=f"{size} bytes")
            return DecoderFile(path, path.read_bytes())

    @staticmethod
    def of(decoder: Decoder, iteration: int, role: str) -> DecoderFile:
        """Return the file of a decoder; the same weights give the same bytes."""
        from gspure.training.pytorch import torch

        stream = io.BytesIO()
        torch.save({name: tensor.contiguous() for name, tensor in decoder.state_dict().items()}, stream)
        return DecoderFile(Path(decoder_name(iteration, role)), stream.getvalue())

    def write(self, folder: Path) -> None:
        """Write it under its name, whole or not at all."""
        with replacing(Path(folder) / self.source.name, checksum=True) as temporary:
            temporary.write_bytes(self.content)

    @cached_property
    def network(self) -> Decoder:
        """The decoder; no code in the file is executed.

        Raise `InputError` if PyTorch is missing, or this is not a state dict of GS-Hider's decoder with finite numbers.
        """
        from gspure.schemes.gs_hider.decoder import Decoder
        from gspure.training.pytorch import torch

        state = read_tensors(self.source, io.BytesIO(self.content))
        decoder = Decoder()
        self._require_names(state, decoder)
        for name, parameter in decoder.state_dict().items():
            self._require_shape(name, tuple(parameter.shape), state[name])
        decoder.load_state_dict({name: torch.from_numpy(tensor.copy()) for name, tensor in state.items()})
        return decoder

    def _require_names(self, state: Mapping[str, Tensor], decoder: Decoder) -> None:
        if any(name.startswith(("bn", "ca")) for name in state):
            layers = ", ".join(name for name, _ in decoder.named_children())
            raise InputError(self.source, "layers", expected=layers, found="further layers", hint=_FORK)
        for name in decoder.state_dict().keys() ^ state.keys():
            found = "a tensor of that name" if name in state else "no such tensor"
            expected = "a tensor" if name not in state else "none"
            raise InputError(self.source, name[:80], expected=expected, found=found)

    def _require_shape(self, name: str, shape: tuple[int, ...], tensor: Tensor) -> None:
        if tensor.dtype != np.float32 or tensor.shape != shape:
            found = f"{tensor.dtype} {list(tensor.shape)}"
            raise InputError(self.source, name, expected=f"float32 {list(shape)}", found=found)
        if not np.isfinite(tensor).all():
            raise InputError(self.source, name, expected="finite numbers", found="others")
