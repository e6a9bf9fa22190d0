"""Figures: numpy in, files out. Only here are pyvista and matplotlib known."""
