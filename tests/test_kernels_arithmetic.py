"""The kernels' own exponential against numpy's."""

import numpy as np
import pyopencl as cl

from gspure.opencl.engine import Engine, Program, by_name
from gspure.opencl.program import build_options, kernel_source

EVALUATE = """
__kernel void evaluate(__global const V *x, __global V *y) {
    y[get_global_id(0)] = exp2_polynomial(x[get_global_id(0)]);
}
"""


def test_exp2_is_within_four_ten_millionths(device, style):
    engine, lanes = Engine(device.cl_device, style), {"cpu": 16, "gpu": 1}[style]
    x = np.linspace(-126, 127, 1 << 14).astype(np.float32)
    source = kernel_source("vector") + EVALUATE
    program = cl.Program(engine.context, source).build(options=build_options({"LANES": lanes}))
    result = engine.allocate(x.nbytes)
    Program(by_name(program), engine.queue, 1).launch("evaluate", x.size // lanes, engine.uploaded(x), result)
    np.testing.assert_allclose(engine.read(result, x.shape, np.float32), np.exp2(x.astype(np.float64)), rtol=4e-7)
