"""GS-Hider's files, in the format of its authors' code.

::

    point_cloud.ply         x y z nx ny nz opacity scale_0..2 rot_0..3 semantic_0..15; features before their sigmoid
    chkpntN_net.pth         state dict of the public scene decoder, N the iteration
    chkpntN_waternet.pth    state dict of the private message decoder

Their code stores the model in ``point_cloud/iteration_N/`` and the decoders in the run's folder. Here, all public files
are in one folder and the private decoder in another. Both layouts are read.
"""

from __future__ import annotations

import io
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Final

import numpy as np

from gspure.errors import InputError, reading
from gspure.files import replacing
from gspure.model import Gaussians, read_model
from gspure.model.gaussians import CORE, NORMALS
from gspure.progress import warn
from gspure.schemes.tensors import read_tensors

if TYPE_CHECKING:
    from gspure.schemes.gs_hider.decoder import Decoder

CHANNELS: Final = 16
FEATURES: Final = tuple(f"semantic_{i}" for i in range(CHANNELS))
COLUMNS: Final = ("x", "y", "z", *NORMALS, *CORE[3:], *FEATURES)
SCENE_DECODER: Final = "net"  # suffix of the file's name
MESSAGE_DECODER: Final = "waternet"  # suffix of the file's name


def read_rows(path: Path) -> Gaussians:
    """Read a model with 16 features per Gaussian, or raise `InputError` if it has other columns."""
    model = read_model(path)
    channels = len(model.columns_named("semantic_"))
    if channels != CHANNELS:
        raise InputError(path, "semantic_*", expected=f"{CHANNELS} properties", found=f"{channels} properties")
    return model


def decoder_name(iteration: int | str, role: str) -> str:
    """Return the name of a decoder's file."""
    return f"chkpnt{iteration}_{role}.pth"


def find_decoder(folder: Path, role: str) -> Path | None:
    """Return the newest decoder in a folder, if there is any.

    For the authors' ``<model>/point_cloud/iteration_N``, it is the decoder of that iteration,
    ``<model>/chkpntN_net.pth``.
    """
    folder = Path(folder).resolve()
    files = {_iteration(file, role): file for file in folder.glob(decoder_name("*", role))}
    if not files and folder.parent.name == "point_cloud":
        file = folder.parents[1] / decoder_name(folder.name.removeprefix("iteration_"), role)
        return file if file.is_file() else None
    if len(files) > 1:
        warn(f"{folder} has {len(files)} files {decoder_name('N', role)}: that of iteration {max(files)} is used")
    return files[max(files)] if files else None


def _iteration(file: Path, role: str) -> int:
    """Return the iteration in the name of a decoder's file; -1 if there is none."""
    number = file.name.removeprefix("chkpnt").removesuffix(f"_{role}.pth")
    return int(number) if number.isdecimal() else -1


LARGEST: Final = 16 << 20  # largest file in bytes; a decoder has half a megabyte

_CONTENT: Final = "a decoder's state dict"
_FORK: Final = "decoders of forks, with batch normalization or channel attention, are not read"


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
        with replacing(Path(folder) / self.source.name) as temporary:
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
        expected = {name: ("float32", tuple(tensor.shape)) for name, tensor in decoder.state_dict().items()}
        found = {name: (str(tensor.dtype), tensor.shape) for name, tensor in state.items()}
        for name in sorted(expected.keys() | found.keys()):
            if expected.get(name) != found.get(name):
                here, there = (str(known.get(name, "no such tensor")) for known in (expected, found))
                raise InputError(self.source, name[:80], expected=here, found=there, hint=_FORK)
            if not np.isfinite(state[name]).all():
                raise InputError(self.source, name, expected="finite numbers", found="others")
        decoder.load_state_dict({name: torch.from_numpy(tensor.copy()) for name, tensor in state.items()})
        return decoder
