"""The rasterizer of 3DGS, in the dialect of the program."""

from gspure_torch.cuda_free.rasterizer import interface
from gspure_torch.cuda_free.replacement import Replacement

__all__ = ["GaussianRasterizationSettings", "GaussianRasterizer"]

GaussianRasterizationSettings, GaussianRasterizer = interface(Replacement.of_this_process().dialect)
