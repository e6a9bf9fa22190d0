"""What needs PyTorch: three schemes as a plug-in of gspure, a bridge to its renderer, programs written for CUDA.

Schemes are declared without PyTorch, which they import when they train or render.
"""

from typing import Final

PYTORCH: Final = {"torch": "gspure[torch]"}
"""`Scheme.packages` of a scheme with networks."""
