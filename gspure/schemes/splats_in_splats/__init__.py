"""Splats in Splats: a hidden scene in the low bits and the opacities of a vanilla model (arXiv 2412.03121)."""

from dataclasses import replace
from functools import partial

from gspure.public_model import PublicModel
from gspure.schemes.scheme import ADAPTIVE, MESSAGE, Scheme
from gspure.schemes.splats_in_splats.embedding import embed
from gspure.schemes.splats_in_splats.key import ORACLE, SplatsInSplatsKey

GEOMETRY = ("x", "y", "z", "scale_*", "rot_*")
CARRIERS = {MESSAGE: (*GEOMETRY, "f_dc_*", "f_rest_*", "opacity"), ADAPTIVE: GEOMETRY, ORACLE: GEOMETRY}

SCHEME = Scheme(
    "splats_in_splats",
    embed,
    PublicModel.read,
    SplatsInSplatsKey.read,
    CARRIERS,
)

HARDENED = replace(SCHEME, name="splats_in_splats_hardened", embed=partial(embed, hardened=2.0))
