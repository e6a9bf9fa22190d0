"""The work of blending: the pixel evaluations of a frame, counted by the kernel itself."""

from dataclasses import replace
from typing import Any

import numpy as np
import pyopencl as cl

from benchmarks.stages import Stages
from gspure.opencl.engine import LANES, Engine, Program, by_name
from gspure.opencl.program import build_options, kernel_source
from gspure.renderer import CONTRIBUTION

FLOPS_PER_EVAL = 26
"""Energy "ewa", three channels, no contributions; an FMA counts as two, 2^x as its polynomial."""

# Blending is unchanged, but every splat contributes 1 to every pixel at which it is evaluated.
_COUNTING = """
inline V evaluation(V exponent, V depth, V *transmittance) {
    blend(exponent, depth, transmittance);
    return (V)1.0f;
}
#define blend evaluation
"""


class _CountingEngine(Engine):
    def program(self, *sources: str, **defines: int) -> Program:
        *shared, blending = sources
        if not blending.startswith("blending_"):
            return super().program(*sources, **defines)
        text = kernel_source(*shared) + _COUNTING + kernel_source(blending)
        options = build_options({"LANES": LANES[self.style], **defines})
        kernels = by_name(cl.Program(self.context, text).build(options=options))
        return Program(kernels, self.queue, 1)


def count_evals(stages: Stages) -> int:
    """Return the number of evaluations of splats at pixels in a frame, including all lanes of a visited row."""
    engine = _CountingEngine(stages.engine.device, stages.engine.style)
    traversal = replace(stages.frame.traversal, contributions=True)
    counting = Stages(engine, stages.model, stages.frame.camera, traversal)
    for stage in (counting.project, counting.sort, counting.bin, counting.blend, counting.sum):
        stage()
    records: Any = engine.read(counting.canvas.records, (len(stages.model),), CONTRIBUTION)
    return int(records["pixels"].sum(dtype=np.int64))
