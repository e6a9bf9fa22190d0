"""Evaluation: image metrics, survival of the message, comparison of attacks, as records in CSV files."""
