"""The function of simple-knn."""

from gspure_torch.cuda_free.neighbours import distCUDA2

__all__ = ["distCUDA2"]
