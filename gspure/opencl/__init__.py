"""OpenCL: devices, programs, and the stages of a frame. Nothing outside this package imports pyopencl."""
