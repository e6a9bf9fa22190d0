"""Splats in Splats: a hidden scene in the low bits and the opacities of a vanilla model (arXiv 2412.03121)."""

from gspure.schemes.asset import Asset
from gspure.schemes.scheme import Scheme
from gspure.schemes.splats_in_splats.embedding import embed
from gspure.schemes.splats_in_splats.key import EXTRACTIONS, SplatsInSplatsKey

SCHEME = Scheme("splats_in_splats", embed, Asset.read, SplatsInSplatsKey.read, EXTRACTIONS)
