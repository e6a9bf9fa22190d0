"""A decoder as its file: copied along byte for byte, and read as data only when an image is wanted."""

from __future__ import annotations

import io
import zipfile
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from gspure.artifacts import replacing
from gspure.errors import InputError, reading
from gspure.schemes.gs_hider.layout import decoder_name

if TYPE_CHECKING:
    from gspure.schemes.gs_hider.decoder import Decoder

LARGEST: Final = 16 << 20
"""Bytes that a file may have or unpack to; a decoder has half a megabyte."""

_CONTENT: Final = "a decoder's state dict"
_FORK: Final = "a fork's decoder, with batch normalization or channel attention; GS-Hider's own has neither"


@dataclass(frozen=True)
class DecoderFile:
    """A PyTorch state dict, untouched: models can be attacked, and written again, where PyTorch is not installed.

    Parameters
    ----------
    source : Path
        Where it was read from, or is to be written: ``chkpntN_net.pth`` or ``chkpntN_waternet.pth``.
    content : bytes

    """

    source: Path
    content: bytes

    @staticmethod
    def read(path: Path) -> DecoderFile:
        """Read a file of reasonable size; `network` judges what it holds."""
        with reading(path, _CONTENT):
            size = path.stat().st_size
            if size > LARGEST:
                raise InputError(path, "file", expected=f"{_CONTENT}, at most {LARGEST} bytes", found=f"{size} bytes")
            return DecoderFile(path, path.read_bytes())

    @staticmethod
    def of(decoder: Decoder, iteration: int, role: str) -> DecoderFile:
        """Return a decoder's file; the same weights give the same bytes."""
        from gspure.schemes.pytorch import torch

        stream = io.BytesIO()
        torch.save({name: tensor.contiguous() for name, tensor in decoder.state_dict().items()}, stream)
        return DecoderFile(Path(decoder_name(iteration, role)), stream.getvalue())

    def write(self, folder: Path) -> None:
        """Write it under its own name, whole or not at all."""
        with replacing(Path(folder) / self.source.name) as temporary:
            temporary.write_bytes(self.content)

    @cached_property
    def network(self) -> Decoder:
        """The decoder.

        Raises
        ------
        InputError
            PyTorch is missing; or the file holds anything but the tensors of GS-Hider's decoder, or numbers that are
            not finite. Nothing that a file holds is run.

        """
        from gspure.schemes.gs_hider.decoder import Decoder

        state = self._state()
        decoder = Decoder()
        self._require_names(state, decoder)
        for name, wanted in decoder.state_dict().items():
            self._require_like(name, wanted, state[name])
        decoder.load_state_dict(state)
        return decoder

    def _state(self) -> dict[str, Any]:
        from gspure.schemes.pytorch import torch

        # PyTorch writes zip archives since its version 1.6. Of older forms, some versions run code even so.
        with (
            reading(self.source, _CONTENT),
            zipfile.ZipFile(io.BytesIO(self.content)) as archive,
        ):
            size = sum(entry.file_size for entry in archive.infolist())
        if size > LARGEST:
            raise InputError(self.source, "file", expected=f"at most {LARGEST} bytes unpacked", found=f"{size}")
        try:
            state = torch.load(io.BytesIO(self.content), map_location="cpu", weights_only=True)
        except Exception as error:  # noqa: BLE001 -- whatever a damaged or hostile file leads its reader to
            found = str(error).partition("\n")[0][:160] or type(error).__name__
            raise InputError(self.source, "file", expected=_CONTENT, found=found) from None
        if not (isinstance(state, dict) and all(isinstance(name, str) for name in state)):
            raise InputError(self.source, "file", expected=_CONTENT, found=f"a {type(state).__name__}")
        return state

    def _require_names(self, state: dict[str, Any], decoder: Decoder) -> None:
        if any(name.startswith(("bn", "ca")) for name in state):
            layers = ", ".join(name for name, _ in decoder.named_children())
            raise InputError(self.source, "layers", expected=layers, found="others beside them", hint=_FORK)
        for name in decoder.state_dict().keys() ^ state.keys():
            found = "a tensor of that name" if name in state else "no such tensor"
            expected = "a tensor" if name not in state else "none"
            raise InputError(self.source, name[:80], expected=expected, found=found)

    def _require_like(self, name: str, wanted: Any, found: Any) -> None:
        from gspure.schemes.pytorch import torch

        if not isinstance(found, torch.Tensor):
            raise InputError(self.source, name, expected="a tensor", found=type(found).__name__)
        if (found.dtype, found.shape) != (wanted.dtype, wanted.shape):
            expected, there = (f"{tensor.dtype} {list(tensor.shape)}" for tensor in (wanted, found))
            raise InputError(self.source, name, expected=expected, found=there)
        if not torch.isfinite(found).all():
            raise InputError(self.source, name, expected="finite numbers", found="others")
