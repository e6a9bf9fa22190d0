"""Evaluation: the job of one variant, and the outcomes of all jobs, compared."""
