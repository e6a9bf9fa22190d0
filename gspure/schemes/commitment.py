"""Commitments: digests of a key and of the model published with it, to show before any dispute.

A key that was made afterwards can fit a stranger's model. So its owner publishes `commitment.json`, or has its digest
dated by somebody else, when he publishes the model. The files of the key have one digest together: with that of its
clean model, whoever guesses the seed of a keyed pattern would have the key.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from hashlib import sha256
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
    files: tuple[str, ...]  # of the key: secret, decoder, clean model
    key: str  # digest of these files together

    @staticmethod
    def of(scheme: str, public: Path, key: Path) -> "Commitment":
        """Return the commitment to a public model's file and the files of a key's folder."""
        files = sorted(file.relative_to(key).as_posix() for file in key.rglob("*") if file.is_file())
        today = datetime.now(UTC).date().isoformat()
        return Commitment(scheme, __version__, today, file_digest(public), tuple(files), _joint_digest(key, files))

    @staticmethod
    def read(path: Path) -> "Commitment":
        """Read a commitment, or raise `InputError`."""
        commitment: Commitment = read(Commitment, read_json(path), path)
        return commitment

    def broken_by(self, scheme: str, key: Path) -> list[str]:
        """Return what differs from the commitment: the scheme, the key."""
        differing = [] if scheme == self.scheme else ["the scheme"]
        has_files = all((key / name).is_file() for name in self.files)
        if not has_files or _joint_digest(key, self.files) != self.key:
            differing.append("the key")
        return differing


def _joint_digest(key: Path, files: Sequence[str]) -> str:
    """Return the SHA-256 of the lines that `sha256sum` prints of the files."""
    lines = (f"{file_digest(key / name)}  {name}\n" for name in files)
    return sha256("".join(lines).encode()).hexdigest()
