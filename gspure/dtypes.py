"""Types of numpy arrays, by their elements."""

import numpy as np
from numpy.typing import NDArray

Float32 = NDArray[np.float32]
Float64 = NDArray[np.float64]
Int32 = NDArray[np.int32]
UInt8 = NDArray[np.uint8]
UInt32 = NDArray[np.uint32]
Bools = NDArray[np.bool_]
Indices = NDArray[np.intp]
