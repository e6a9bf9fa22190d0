"""The rasterization of gsplat, where gsplat itself is not installed."""

from gspure.cuda_free.gsplat import rasterization

__all__ = ["rasterization"]
