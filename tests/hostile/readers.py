"""Everything in the package that reads a file."""

from tests.hostile import result_files, user_files

READERS = (*user_files.READERS, *result_files.READERS)
BY_NAME = {reader.name: reader for reader in READERS}
