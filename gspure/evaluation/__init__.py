"""Evaluation: image metrics, agreement with a known truth, and tables."""
