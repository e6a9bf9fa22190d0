"""The surface that a model shows, and how far from it each of its Gaussians lies."""
