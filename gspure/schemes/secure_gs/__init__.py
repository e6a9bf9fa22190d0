"""SecureGS (Zhang et al. 2025) over Scaffold-GS: public anchors, of which private networks make other Gaussians."""

from gspure.schemes.scheme import Scheme
from gspure.schemes.secure_gs.asset import AnchorAsset
from gspure.schemes.secure_gs.embedding import embed
from gspure.schemes.secure_gs.key import HiddenKey

SCHEME = Scheme("secure_gs", embed, AnchorAsset.read, HiddenKey.read, tau_c=3.0, tau_n=2.0)
