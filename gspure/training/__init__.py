"""Training: a 3DGS model from photographs, on any OpenCL device."""
