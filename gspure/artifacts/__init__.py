"""Files of results: whole or absent, with a checksum beside them, and checked when they are read."""

from gspure.artifacts.arrays import load_array, load_arrays, save_array, save_arrays
from gspure.artifacts.checksums import digest, distinct, file_digest, intact, record_of, verify
from gspure.artifacts.files import filling, read_json, replacing, require_place, write_json, write_text
from gspure.artifacts.provenance import (
    UNMOVED,
    embedding_of,
    facts_of,
    known_digest,
    measured_settings,
    motion_of,
    recorded_inputs,
    require_agreement,
    require_embedding,
    require_kind,
    require_same_origin,
    settings_of,
    write_record,
)
from gspure.artifacts.replacement import RENDERED, place, remove, replacing_only, require_replaceable

__all__ = [
    "RENDERED",
    "UNMOVED",
    "digest",
    "distinct",
    "embedding_of",
    "facts_of",
    "file_digest",
    "filling",
    "intact",
    "known_digest",
    "load_array",
    "load_arrays",
    "measured_settings",
    "motion_of",
    "place",
    "read_json",
    "record_of",
    "recorded_inputs",
    "remove",
    "replacing",
    "replacing_only",
    "require_agreement",
    "require_embedding",
    "require_kind",
    "require_place",
    "require_replaceable",
    "require_same_origin",
    "save_array",
    "save_arrays",
    "settings_of",
    "verify",
    "write_json",
    "write_record",
    "write_text",
]
