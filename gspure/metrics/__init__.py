"""Metrics: of images, of what detectors read, of retrieval; their statistics, and their tables in CSV files."""
