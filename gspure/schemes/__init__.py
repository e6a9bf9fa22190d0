"""Watermarking schemes: how a message is hidden in a scene, published, and seen again by its owner."""
