"""Marked Clones, of the family of GaussianMarker (Huang et al. 2024): bits that a network reads from any render."""

import math

from gspure.evaluation.outcomes import BITS
from gspure.public_model import PublicModel
from gspure.schemes.marked_clones.embedding import embed, read_key
from gspure.schemes.scheme import PYTORCH, Scheme

RANGES = {"cloned": (0.01, 1.0)} | dict.fromkeys(("bits", "decoder_steps", "marking_steps"), (1.0, math.inf))
RENDERED = ("x", "y", "z", "f_dc_*", "f_rest_*", "opacity", "scale_*", "rot_*")

SCHEME = Scheme("marked_clones", embed, PublicModel.read, read_key, {BITS: RENDERED}, RANGES, packages=PYTORCH)
