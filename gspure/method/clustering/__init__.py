"""Exact HDBSCAN in two steps: an expensive spanning tree, and a cheap selection of clusters from it."""
