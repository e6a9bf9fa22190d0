"""The rasterization of gsplat, where gsplat itself is not installed."""

from gspure_torch.cuda_free.replacement import gsplat_rasterization

__all__ = ["rasterization"]

rasterization = gsplat_rasterization()
