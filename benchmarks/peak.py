"""The peak of fused multiply-adds of this machine: compiled natively, and by its OpenCL driver."""

import ctypes
import shutil
import subprocess
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pyopencl as cl

from benchmarks.timing import CORES, Times
from gspure.opencl.engine import Engine

CHAINS = 12
"""Independent accumulators. An FMA takes 4 cycles and two begin in each, so 8 are needed; with the two factors, they
must fit the 16 vector registers of AVX2."""

STEPS = 4_000_000

_NATIVE = """
typedef float V __attribute__((vector_size(4 * LANES)));
float fma_chains(long steps, float a, float b) {
    V x[CHAINS];
    for (int i = 0; i < CHAINS; i++) x[i] = (V){} + (float)i;
    V va = (V){} + a, vb = (V){} + b;
    for (long s = 0; s < steps; s++)
#pragma GCC unroll 12
        for (int i = 0; i < CHAINS; i++) x[i] = x[i] * va + vb;
    float sum = 0;
    for (int i = 0; i < CHAINS; i++)
        for (int lane = 0; lane < LANES; lane++) sum += x[i][lane];
    return sum;
}
"""

_OPENCL = """
__kernel __attribute__((reqd_work_group_size(1, 1, 1)))
void fma_chains(uint steps, float a, float b, __global float *sums) {
    V x[CHAINS];
    for (int i = 0; i < CHAINS; i++) x[i] = (V)(i + get_global_id(0));
    V va = (V)a, vb = (V)b;
    for (uint s = 0; s < steps; s++) {
#pragma unroll
        for (int i = 0; i < CHAINS; i++) x[i] = fma(x[i], va, vb);
    }
    V sum = (V)0.0f;
    for (int i = 0; i < CHAINS; i++) sum += x[i];
    float all[LANES];
    VSTORE(sum, 0, all);
    for (int lane = 1; lane < LANES; lane++) all[0] += all[lane];
    sums[get_global_id(0)] = all[0];
}
"""


def lanes(engine: Engine) -> int:
    """Return the number of floats in a vector with the most FMA per second.

    It is measured, since the driver reports the processor's number even if it compiles for another processor.
    """
    rates = {}
    for width in (4, 8, 16):
        times = Times()
        run = opencl(engine, width)
        run()
        times.measure(run)
        rates[width] = width / times.cpu[0]
    return max(rates, key=rates.__getitem__)


def flops(width: int) -> int:
    """Return the floating-point operations of one run, native or OpenCL; every core does the same number."""
    return 2 * width * CHAINS * STEPS * CORES


def native(width: int, folder: Path) -> Callable[[], object] | None:
    """Compile the C program in `folder`; return a function that runs it on all cores, or None without a compiler."""
    compiler = shutil.which("gcc")
    if compiler is None:
        return None
    source = folder / "fma.c"
    library = folder / "fma.so"
    source.write_text(_NATIVE, encoding="utf-8")
    options = ["-O3", "-march=native", f"-DCHAINS={CHAINS}", f"-DLANES={width}", "-shared", "-fPIC"]
    subprocess.run([compiler, *options, str(source), "-o", str(library)], check=True)
    chains = ctypes.CDLL(str(library)).fma_chains
    chains.argtypes = (ctypes.c_long, ctypes.c_float, ctypes.c_float)
    chains.restype = ctypes.c_float
    pool = ThreadPoolExecutor(CORES)

    def run() -> None:
        for part in [pool.submit(chains, STEPS, 0.999, 0.001) for _ in range(CORES)]:
            part.result()

    return run


def opencl(engine: Engine, width: int) -> Callable[[], object]:
    """Return a function that runs the OpenCL program on all cores."""
    options = [f"-DCHAINS={CHAINS}", f"-DLANES={width}", f"-DV=float{width}", f"-DVSTORE=vstore{width}"]
    program = cl.Program(engine.context, _OPENCL).build(options=options)
    kernel = cl.Kernel(program, "fma_chains")
    parts = 8 * CORES
    sums = engine.allocate(4 * parts)

    def run() -> None:
        steps = np.uint32(STEPS * CORES // parts)
        kernel(engine.queue, (parts,), (1,), steps, np.float32(0.999), np.float32(0.001), sums)
        engine.queue.finish()

    return run
