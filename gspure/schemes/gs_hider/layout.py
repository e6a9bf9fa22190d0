"""GS-Hider's files, in the format of its authors' code.

::

    point_cloud.ply         x y z nx ny nz opacity scale_0..2 rot_0..3 semantic_0..15; features before their sigmoid
    chkpntN_net.pth         state dict of the public scene decoder, N the iteration
    chkpntN_waternet.pth    state dict of the private message decoder

Their code stores the model in ``point_cloud/iteration_N/`` and the decoders in the run's folder. Here, all public files
are in one folder and the private decoder in another. Both layouts are read.
"""

from pathlib import Path
from typing import Final

from gspure.artifacts import embedding_of
from gspure.errors import InputError
from gspure.model import Gaussians, read_model
from gspure.model.gaussians import CORE, NORMALS
from gspure.progress import warn

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
        hint = "the column semantic_0 marks a model of GS-Hider"
        found = f"{channels} properties"
        raise InputError(path, "semantic_*", expected=f"{CHANNELS} properties", found=found, hint=hint)
    return model


def decoder_name(iteration: int | str, role: str) -> str:
    """Return the name of a decoder's file."""
    return f"chkpnt{iteration}_{role}.pth"


def find_decoder(folder: Path, role: str, embedding: str = "") -> Path | None:
    """Return the newest decoder in a folder, if there is any; of the embedding, if some are.

    For the authors' ``<model>/point_cloud/iteration_N``, it is the decoder of that iteration,
    ``<model>/chkpntN_net.pth``.
    """
    folder = Path(folder).resolve()
    files = {_iteration(file, role): file for file in folder.glob(decoder_name("*", role))}
    if not files and folder.parent.name == "point_cloud":
        file = folder.parents[1] / decoder_name(folder.name.removeprefix("iteration_"), role)
        return file if file.is_file() else None
    files = {n: file for n, file in files.items() if embedding and embedding_of(file) == embedding} or files
    if len(files) > 1:
        warn(f"{folder} has {len(files)} files {decoder_name('N', role)}: that of iteration {max(files)} is used")
    return files[max(files)] if files else None


def _iteration(file: Path, role: str) -> int:
    """Return the iteration in the name of a decoder's file; -1 if there is none."""
    number = file.name.removeprefix("chkpnt").removesuffix(f"_{role}.pth")
    return int(number) if number.isdecimal() else -1
