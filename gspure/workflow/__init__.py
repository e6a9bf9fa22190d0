"""What the workflow knows beyond Snakemake: its configuration, and the files and options of its jobs."""
