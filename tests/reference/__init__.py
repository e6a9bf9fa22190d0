"""The renderer's oracle: every kernel once more in float64 numpy, brute force over pixels x Gaussians.

Written to be read and checked against the papers, not to be fast: sizes up to a few hundred Gaussians and 100 x 80
pixels. Nothing in the pipeline imports it; the tests compare the OpenCL kernels with it.
"""
