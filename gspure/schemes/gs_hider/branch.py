"""A branch of the training: a decoder of the shared feature map, and its target photographs."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gspure.schemes.gs_hider.decoder import Decoder
from gspure.schemes.gs_hider.loss import differentiated
from gspure.schemes.pair import Capture

Float32 = NDArray[np.float32]


class Branch:
    """A decoder in training.

    Parameters
    ----------
    decoder : Decoder
    capture : Capture
        Its views and photographs.
    weight : float
        Of its loss.

    """

    def __init__(self, decoder: Decoder, capture: Capture, weight: float) -> None:
        self.decoder = decoder
        self.views = capture.views
        self._images = capture.images
        self._weight = weight

    def differentiate(self, feature_map: Float32, view: int) -> tuple[float, Float32]:
        """Return the loss of a view and its gradient of the feature map; the decoder stores its own gradients."""
        return differentiated(self.decoder, feature_map, self._images[view], self._weight)
