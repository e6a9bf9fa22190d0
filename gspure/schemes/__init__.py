"""Watermarking schemes: they hide a message in a scene, publish the model and extract the message."""
