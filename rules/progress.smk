# For `gspure audit`, a bar or problems only take the place of Snakemake's lines on the screen. Its log file has all lines.

import logging

import gspure.progress
from gspure.workflow.job_progress import SHOWN, JobProgress
from snakemake.logging import logger

SCREEN = JobProgress() if os.environ.get(SHOWN) else None
if SCREEN:
    gspure.progress.quiet = os.environ[SHOWN] == "problems"
    for handler in [handler for handler in logger.handlers if not isinstance(handler, logging.FileHandler)]:
        logger.removeHandler(handler)
    logger.addHandler(SCREEN)
