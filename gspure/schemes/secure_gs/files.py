"""Networks on disk: the public ones in Scaffold-GS's files, the private ones in ours.

::

    <folder>/checkpoints.pth                                          all state dicts ("unite"); read and written
    <folder>/{opacity,cov,color}_mlp.pt [feature_bank_mlp.pt]         one TorchScript trace each ("split"); read
    <key>/securegs_hidden.npz                                         {offset,opacity,cov,color}.{0,2}.{weight,bias}
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Final

import numpy as np

from gspure.artifacts import load_arrays, save_arrays, verify
from gspure.artifacts.arrays import Kind
from gspure.errors import InputError
from gspure.files import Float32
from gspure.progress import warn
from gspure.schemes.secure_gs.networks import PARAMETERS, Networks
from gspure.schemes.tensors import Tensor, read_tensors, write_tensors

Loaded = dict[str, dict[str, Float32]]

PUBLIC: Final = ("opacity", "cov", "color")
BANK: Final = "feature_bank"
PRIVATE: Final = ("offset", *PUBLIC)
UNITED: Final = "checkpoints.pth"
HIDDEN: Final = "securegs_hidden.npz"

_APPEARANCE: Final = ("appearance", "embedding_appearance")


def network_files(folder: Path) -> list[Path]:
    """Return the files of the public networks in a folder that `read_networks` prefers."""
    return [path for path in (folder / UNITED,) if path.is_file()] or sorted(folder.glob("*_mlp.pt"))


def read_networks(folder: Path) -> Loaded:
    """Read the public networks in a folder.

    Raise `InputError` if a file or parameter is missing, a file holds more than tensors, or there are appearance
    embeddings.
    """
    united = folder / UNITED
    if united.is_file():
        if any(folder.glob("*_mlp.pt")):
            warn(f"{folder} has {UNITED} and networks *_mlp.pt: {UNITED} is used")
        verify(united)
        return _by_network(united, read_tensors(united))
    tensors: dict[str, Tensor] = {}
    for name in (*PUBLIC, BANK):
        file = folder / f"{name}_mlp.pt"
        if name != BANK or file.is_file():
            if not file.is_file():
                found = f"neither it nor {UNITED}"
                raise InputError(file, "file", expected="a network beside the .ply", found=found)
            tensors |= {f"{name}_mlp.{parameter}": array for parameter, array in read_tensors(file).items()}
    return _by_network(folder, tensors)


def write_networks(folder: Path, networks: Networks) -> None:
    """Write the public networks in Scaffold-GS's united format."""
    write_tensors(folder / UNITED, {f"{name}_mlp": network for name, network in networks.items()})


def read_hidden(folder: Path) -> Loaded:
    """Read the private networks in a folder."""
    kinds: dict[str, Kind] = {
        f"{name}.{parameter}": (np.float32, (None, None) if parameter.endswith("weight") else (None,))
        for name in PRIVATE
        for parameter in PARAMETERS
    }
    arrays = load_arrays(Path(folder) / HIDDEN, kinds, "the private networks of SecureGS")
    return {name: {p: arrays[f"{name}.{p}"] for p in PARAMETERS} for name in PRIVATE}


def write_hidden(folder: Path, networks: Networks) -> None:
    """Write the private networks."""
    named = {f"{name}.{parameter}": array for name, net in networks.items() for parameter, array in net.items()}
    save_arrays(Path(folder) / HIDDEN, named)


def _by_network(source: Path, tensors: Mapping[str, Tensor]) -> Loaded:
    if any(name.split(".")[0] in _APPEARANCE for name in tensors):
        hint = "train with appearance_dim 0, as Scaffold-GS's own scripts do"
        raise InputError(source, "appearance", expected="none", found="an embedding per photograph", hint=hint)
    names = [*PUBLIC, *([BANK] if any(name.startswith(f"{BANK}_mlp.") for name in tensors) else [])]
    for missing in {f"{name}_mlp.{parameter}" for name in names for parameter in PARAMETERS} - tensors.keys():
        raise InputError(source, missing, expected="a network's parameter", found="no such tensor")
    networks = {name: {parameter: tensors[f"{name}_mlp.{parameter}"] for parameter in PARAMETERS} for name in names}
    for name, parameter, tensor in ((n, p, tensor) for n, net in networks.items() for p, tensor in net.items()):
        if tensor.dtype != np.float32:
            raise InputError(source, f"{name}.{parameter}", expected="float32 numbers", found=str(tensor.dtype))
    return networks
