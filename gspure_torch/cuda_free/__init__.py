"""Programs written for CUDA, on any machine: modules under the names that they import, over gspure's renderer.

`modules/` holds these modules, and `startup/` what Python imports at its start. Neither is on the path of a program
unless ``gspure cuda-free`` runs it.
"""
