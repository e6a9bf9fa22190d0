"""Evaluation: image metrics, survival of the message, comparison of attacks, as typed tables in CSV files."""
