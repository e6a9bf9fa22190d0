"""GS-Hider (Zhang et al. 2024): one feature map; a public network decodes the scene, a private one the message."""

from dataclasses import replace
from functools import partial

from gspure.schemes.gs_hider.embedding import embed
from gspure.schemes.gs_hider.key import DecoderKey
from gspure.schemes.gs_hider.layout import SCENE_DECODER, decoder_name
from gspure.schemes.gs_hider.public_model import FeatureModel
from gspure.schemes.scheme import ADAPTIVE, MESSAGE, PYTORCH, Scheme

CARRIER = ("x", "y", "z", "semantic_*", "opacity", "scale_*", "rot_*")

SCHEME = Scheme(
    "gs_hider",
    embed,
    FeatureModel.read,
    DecoderKey.read,
    {MESSAGE: CARRIER, ADAPTIVE: CARRIER},
    signature=("semantic_0",),
    beside=(decoder_name("*", SCENE_DECODER),),
    packages=PYTORCH,
    fits=True,
)

HARDENED = replace(SCHEME, name="gs_hider_hardened", embed=partial(embed, hardened=2.0))
