"""The schemes of this package, as gspure finds them: by the entry point ``networks``."""

from typing import Final

from gspure.plugins import Plugin
from gspure_torch import gs_hider, keyss, secure_gs

PLUGIN: Final = Plugin(
    schemes=(
        gs_hider.SCHEME,
        gs_hider.HARDENED,
        gs_hider.CANONICAL,
        secure_gs.SCHEME,
        secure_gs.HARDENED,
        secure_gs.CANONICAL,
        keyss.SCHEME,
        keyss.CANONICAL,
    )
)
