"""Whether a model hides anything: statistics of its file and weights, and a verdict calibrated on clean models."""
