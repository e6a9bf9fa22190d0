"""The configuration of the workflow, and the files and options of its jobs; without Snakemake."""
