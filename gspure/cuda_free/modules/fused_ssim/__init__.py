"""The function of fused-ssim."""

from gspure.cuda_free.similarity import fused_ssim

__all__ = ["fused_ssim"]
