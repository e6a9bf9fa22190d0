"""KeySS (Ren et al. 2025): with a key, a network turns the Gaussians of a vanilla model into those of the message."""

from gspure.public_model import PublicModel
from gspure.schemes.keyss.embedding import embed
from gspure.schemes.keyss.key import NetworkKey
from gspure.schemes.scheme import ADAPTIVE, MESSAGE, PYTORCH, Scheme

CARRIER = ("x", "y", "z", "f_dc_*", "f_rest_*", "opacity", "scale_*", "rot_*")

SCHEME = Scheme(
    "keyss",
    embed,
    PublicModel.read,
    NetworkKey.read,
    {MESSAGE: CARRIER, ADAPTIVE: CARRIER},
    packages=PYTORCH,
    fits=True,
)
