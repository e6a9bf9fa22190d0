"""The archives of public captures, and the image size at which the 3DGS papers evaluate each.

The publishers give no digests; see `gspure.datasets.fetch`.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Final

from gspure.errors import InputError


@dataclass(frozen=True)
class Archive:
    """A zip file of captures, each a COLMAP project, in a `folder` of the archive.

    `terms` are the known terms of use, in a sentence or two; `photographs` are, by scene, the folder of the photographs
    that papers evaluate on.
    """

    url: str
    terms: str
    photographs: Mapping[str, str] = field(hash=False)
    folder: str = ""

    @property
    def name(self) -> str:
        """The file's name."""
        return self.url.rpartition("/")[2]


_MIPNERF360 = (
    "Mip-NeRF 360 (Barron et al., CVPR 2022), https://jonbarron.info/mipnerf360: no licence is stated, so assume "
    "research use only, and no right to redistribute."
)
_DEEP_BLENDING = (
    "Playroom of Deep Blending (Hedman et al., SIGGRAPH Asia 2018), as prepared by the authors of 3DGS: see the terms "
    "at https://repo-sam.inria.fr/fungraph/3d-gaussian-splatting."
)
_INDOOR: Final = "images_2"
_OUTDOOR: Final = "images_4"

ARCHIVES: Final = (
    Archive(
        "https://storage.googleapis.com/gresearch/refraw360/360_v2.zip",
        _MIPNERF360,
        {
            **dict.fromkeys(("bicycle", "garden", "stump"), _OUTDOOR),
            **dict.fromkeys(("bonsai", "counter", "kitchen", "room"), _INDOOR),
        },
    ),
    Archive(
        "https://storage.googleapis.com/gresearch/refraw360/360_extra_scenes.zip",
        _MIPNERF360,
        dict.fromkeys(("flowers", "treehill"), _OUTDOOR),
    ),
    Archive(
        "https://repo-sam.inria.fr/fungraph/3d-gaussian-splatting/datasets/input/tandt_db.zip",
        _DEEP_BLENDING,
        {"playroom": "images"},
        folder="db",
    ),
)
"""As the 3DGS papers: outdoor scenes at a quarter of their size, indoor scenes at a half, Deep Blending as it is."""

SCENES: Final = tuple(scene for archive in ARCHIVES for scene in archive.photographs)


def archive_of(scene: str) -> Archive:
    """Return the archive that holds a scene, or raise `InputError` if none does."""
    for archive in ARCHIVES:
        if scene in archive.photographs:
            return archive
    raise InputError("download", "SCENE", expected=f"one of {', '.join(SCENES)}", found=scene)
