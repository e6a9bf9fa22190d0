"""The function of fused-ssim."""

from gspure_torch.cuda_free.similarity import fused_ssim

__all__ = ["fused_ssim"]
