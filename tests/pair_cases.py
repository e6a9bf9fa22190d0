"""A small ray-traced pair, made once per session, for the tests of schemes."""

from pathlib import Path

from gspure.cli import main


def small_pair(folder: Path, placement: str = "raised", views: int = 12, protocol: str = "shared") -> Path:
    """Return the folder of a pair of `views` views of 48x36 pixels."""
    size = ("--views", str(views), "--width", "48", "--height", "36")
    options = ("--placement", placement, "--protocol", protocol, *size)
    assert main(["pair", "room", "vault", *options, "--out", str(folder)]) == 0
    return folder
