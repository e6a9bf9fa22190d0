"""PyTorch, which schemes with networks need and all else does without; whoever imports this without it is told so."""

from gspure.errors import InputError

try:
    import torch
except ImportError as error:
    hint = "pip install gspure[torch]"
    raise InputError("torch", "package", expected="PyTorch", found=str(error), hint=hint) from None

__all__ = ["torch"]
