"""Public benchmark captures: their archives, downloaded and unpacked as training reads them."""

from gspure.datasets.archives import ARCHIVES, SCENES, Archive, archive_of
from gspure.datasets.extraction import extract
from gspure.datasets.fetching import fetch

__all__ = ["ARCHIVES", "SCENES", "Archive", "archive_of", "extract", "fetch"]
