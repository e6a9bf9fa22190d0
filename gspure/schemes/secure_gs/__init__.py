"""SecureGS (Zhang et al. 2025) on Scaffold-GS: public anchors, from which private networks compute other Gaussians."""

from dataclasses import replace
from functools import partial

from gspure.constants import ANCHOR_TAU_C, ANCHOR_TAU_N
from gspure.schemes.scheme import ADAPTIVE, MESSAGE, PYTORCH, Scheme
from gspure.schemes.secure_gs.embedding import embed
from gspure.schemes.secure_gs.files import UNITED
from gspure.schemes.secure_gs.key import HiddenKey
from gspure.schemes.secure_gs.public_model import AnchorModel

CARRIER = ("x", "y", "z", "f_anchor_feat_*", "scale_*")
"""Without the offsets, which only the scene uses, and the opacities and rotations, which are unused constants."""

SCHEME = Scheme(
    "secure_gs",
    embed,
    AnchorModel.read,
    HiddenKey.read,
    {MESSAGE: CARRIER, ADAPTIVE: CARRIER},
    tau_c=ANCHOR_TAU_C,
    tau_n=ANCHOR_TAU_N,
    signature=("f_anchor_feat_0", "f_offset_0"),
    beside=(UNITED, "*_mlp.pt"),
    packages=PYTORCH,
    fits=True,
)

HARDENED = replace(SCHEME, name="secure_gs_hardened", embed=partial(embed, hardened=2.0))
