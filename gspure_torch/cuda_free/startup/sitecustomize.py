"""Python imports this at its start, in every process of a program that ``gspure cuda-free`` runs."""

from gspure_torch.cuda_free.replacement import install

install()
