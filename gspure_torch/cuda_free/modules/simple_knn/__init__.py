"""Distances to neighbours: see `_C`."""
