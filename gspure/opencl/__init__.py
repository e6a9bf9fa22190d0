"""OpenCL: devices, programs, and the steps of a frame. Nothing outside this package imports pyopencl."""
