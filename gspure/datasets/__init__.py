"""Public captures that the field compares on: where they are, fetched and unpacked as a training takes them."""

from gspure.datasets.archives import ARCHIVES, SCENES, Archive, archive_of
from gspure.datasets.extraction import extract
from gspure.datasets.fetching import fetch

__all__ = ["ARCHIVES", "SCENES", "Archive", "archive_of", "extract", "fetch"]
