"""Metrics of images, evidence of messages, their statistics, and tables in CSV files."""
