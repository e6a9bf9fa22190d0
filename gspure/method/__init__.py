"""GSPure, in the paper's order."""
