"""Commitments: digests of a key and of the model published with it, to show before any dispute.

A key that was made afterwards can fit a stranger's model. So its owner publishes `commitment.json`, or has its digest
dated by somebody else, when he publishes the model; it gives nothing of the key away.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Final

from gspure import __version__
from gspure.codec import read
from gspure.files import file_digest, read_json

COMMITMENT: Final = "commitment.json"  # beside the folders of the key and of the public model


@dataclass(frozen=True)
class Commitment:
    """What an owner commits to; digests are SHA-256."""

    scheme: str
    gspure: str  # version
    date: str  # of the embedding, UTC; only a date by somebody else proves anything
    public: str  # digest of the public model's file
    key: Mapping[str, str]  # digests of the key's files: secret, decoder, clean model

    @staticmethod
    def of(scheme: str, public: Path, key: Path) -> "Commitment":
        """Return the commitment to a public model's file and the files of a key's folder."""
        files = sorted(file for file in key.rglob("*") if file.is_file())
        digests = {file.relative_to(key).as_posix(): file_digest(file) for file in files}
        return Commitment(scheme, __version__, datetime.now(UTC).date().isoformat(), file_digest(public), digests)

    @staticmethod
    def read(path: Path) -> "Commitment":
        """Read a commitment, or raise `InputError`."""
        commitment: Commitment = read(Commitment, read_json(path), path)
        return commitment

    def broken_by(self, scheme: str, key: Path) -> list[str]:
        """Return what differs from the commitment: the scheme, or files of the key."""
        differing = [] if scheme == self.scheme else ["the scheme"]
        files = {name: key / name for name in self.key}
        return differing + [
            name for name, file in files.items() if not file.is_file() or file_digest(file) != self.key[name]
        ]
