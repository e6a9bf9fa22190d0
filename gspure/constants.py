"""Every numeric constant of the renderer and of the method, with its source.

Those of GOF are from Yu et al. 2024, those of the paper from Huang et al. 2026.

Kernels receive the renderer's constants as ``-D`` definitions, so that there is one place to read and to change them.
"""

from typing import Final, Literal, get_args

# --- Rasterization rules, as the published 3DGS models were trained with (Kerbl et al. 2023, reference rasterizer) ----

TILE: Final = 16  # side of a square screen tile, in pixels

LARGEST: Final = 1e18  # largest number of a view or a point: its square is finite in float32; ours
NEAR_PLANE: Final = 0.2
"""Gaussians with a centre of at most this view-space depth are dropped, and so are ray maxima of at most this depth."""

ALPHA_MIN: Final = 1.0 / 255.0  # a Gaussian touches a pixel when its alpha there is at least this
ALPHA_MAX: Final = 0.99  # upper clamp of alpha
TRANSMITTANCE_MIN: Final = 1e-4  # a pixel stops *before* the Gaussian that would bring its transmittance below this
EWA_DILATION: Final = 0.3  # added to the diagonal of the 2-D covariance, in square pixels (EWA's low-pass filter)

EWA_FRUSTUM_MARGIN: Final = 0.3
"""In the EWA Jacobian, x/z and y/z are clamped to the image's frustum, widened by this share of its half extent."""

MEDIAN_TRANSMITTANCE: Final = 0.5  # the median depth is that of the Gaussian at which transmittance falls to this (GOF)
SH_DC: Final = 0.28209479177387814  # zeroth real spherical harmonic, 1 / (2 sqrt(pi)): colour = SH_DC * f_dc + 0.5

MAX_SH_DEGREE: Final = 3  # of spherical harmonics

# --- Range of numbers: limits that keep float32 from overflowing for any finite input. Ours. --------------------------

MAGNITUDE_MAX: Final = 1e30
"""A quaternion, or the middle scale of a Gaussian under ``ray``, is usable from 1 / MAGNITUDE_MAX to MAGNITUDE_MAX."""

COORDINATE_MAX: Final = 1e15  # largest magnitude of the view-space coordinates of a drawn Gaussian

NEAR_CENTRE: Final = 10.0
"""A camera with a larger coordinate becomes the origin of its frame, since float32 would lose digits."""

RAY_SCALE_RATIO: Final = 1e8
"""Energy ``ray``: the smallest and the largest scale are clamped to this ratio to the middle one."""

EWA_DEVIATION_MAX: Final = 1e8  # energy `ewa`: upper clamp of a standard deviation on the image plane, in pixels
COLOUR_MAX: Final = 1e30  # upper clamp of a colour

# --- Device memory. Ours. --------------------------------------------------------------------------------------------

BLOCK: Final = 16  # Gaussians of a block: attributes are stored as [blocks][attributes][BLOCK], one vector load each
GEOMETRY_ATTRIBUTES: Final = 11  # means 3, quaternions 4, scales 3, opacity 1
FOOTPRINT_FLOATS: Final = 8  # floats of a footprint, the input of binning
MOMENTS: Final = 6  # moments of a splat's gradient over the pixels of a tile
LEAF: Final = 16  # most points in a leaf of the k-d tree

# --- GSPure, paper §Methodology; where the paper names no value, the choice is ours -----------------------------------

TAU_C: Final = 4.0  # cluster pruning factor, paper §Implementation Details (for Splats in Splats and GS-Hider)
TAU_N: Final = 4.0  # noise pruning factor, paper §Implementation Details (for Splats in Splats and GS-Hider)
ANCHOR_TAU_C: Final = 3.0  # for SecureGS, whose rows are anchors
ANCHOR_TAU_N: Final = 2.0  # for SecureGS, whose rows are anchors
MIN_SAMPLES: Final = 10  # HDBSCAN's min_samples; ours: the paper names none
MIN_CLUSTER_SIZE: Final = 50  # HDBSCAN's min_cluster_size; ours: the paper names none

MAX_CLUSTER_SHARE: Final = 0.1
"""Largest share of all Gaussians that one excess-of-mass cluster may hold. Ours: plain eom collapses on many scenes."""

NOISE_LABEL: Final = -1  # label of a noise point, as in HDBSCAN

# --- Training: Kerbl et al. 2023, Adam's defaults --------------------------------------------------------------------

ADAM_BETA1: Final = 0.9  # decay of the first moment, Kingma & Ba 2015
ADAM_BETA2: Final = 0.999  # of the second
ADAM_EPSILON: Final = 1e-15  # 3DGS's, far below Adam's default: gradients of a mean over pixels are small

# --- Evaluation ------------------------------------------------------------------------------------------------------

SSIM_WINDOW: Final = 11  # side of the Gaussian window in pixels, as all of SSIM: Wang et al. 2004
SSIM_SIGMA: Final = 1.5  # of the window, in pixels
SSIM_C1: Final = 0.01**2  # for images from 0 to 1
SSIM_C2: Final = 0.03**2  # likewise
MS_SSIM_WEIGHTS: Final = (0.0448, 0.2856, 0.3001, 0.2363, 0.1333)  # of the scales; Wang, Simoncelli and Bovik 2003

TEST_EVERY: Final = 8  # with cameras sorted by name, every eighth one is held out (3DGS's `--eval` split)

# --- Energies --------------------------------------------------------------------------------------------------------

Energy = Literal["ewa", "ray", "center_ray"]
"""The value of a Gaussian at a pixel: a 2-D splat; its maximum along the ray (paper, Eq. E); or its maximum along the
ray through its centre."""

ENERGIES: Final[tuple[Energy, ...]] = get_args(Energy)  # their names
