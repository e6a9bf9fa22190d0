"""The surface of a model, and the distances of its Gaussians from it."""
