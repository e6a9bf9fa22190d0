"""All readers that the torture tries."""

from tests.hostile import user_files

READERS = user_files.READERS
BY_NAME = {reader.name: reader for reader in READERS}
