"""Marked Clones, of the family of GaussianMarker (Huang et al. 2024): bits that a network reads from any render."""

from gspure.evaluation.outcomes import BITS
from gspure.public_model import PublicModel
from gspure.schemes.marked_clones.embedding import embed, read_key
from gspure.schemes.scheme import PYTORCH, Scheme

RENDERED = ("x", "y", "z", "f_dc_*", "f_rest_*", "opacity", "scale_*", "rot_*")

SCHEME = Scheme("marked_clones", embed, PublicModel.read, read_key, {BITS: RENDERED}, packages=PYTORCH)
