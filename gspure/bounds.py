"""Bounds: every number that a user may set has a least and a largest value, declared where it is defined.

Options of commands take a `Range`, settings of attacks and schemes are annotated with one (`gspure.settings`), and the
schema of the configuration repeats the same numbers. The largest values are ours, far above what is useful.
"""

from numbers import Integral, Real
from pathlib import Path
from typing import Annotated, Any, Final, NamedTuple

from gspure.errors import InputError


class Range(NamedTuple):
    """Numbers from `least` to `most`; whole ones if `least` is an int; if `above`, without `least` itself."""

    least: float
    most: float
    above: bool = False

    @property
    def kind(self) -> type[int] | type[float]:
        """The type of its numbers."""
        return int if isinstance(self.least, int) else float

    def __str__(self) -> str:
        least, most = (f"{end:d}" if isinstance(end, int) else f"{end:.12g}" for end in (self.least, self.most))
        return f"above {least}, at most {most}" if self.above else f"{least} to {most}"

    @property
    def expected(self) -> str:
        """The range in words, for refusals."""
        return f"a {'whole ' * (self.kind is int)}number {'' if self.above else 'from '}{self}"

    def __contains__(self, value: Any) -> bool:
        is_number = isinstance(value, Integral if self.kind is int else Real) and not isinstance(value, bool)
        return is_number and bool(self.least <= value <= self.most) and not (self.above and value == self.least)

    def require(self, source: str | Path, field: str, value: object) -> None:
        """Raise `InputError` for the `field` of a source unless its value is in the range."""
        if value not in self:
            found = repr(value) if isinstance(value, str) else str(value)
            raise InputError(source, field, expected=self.expected, found=found)

    def parse(self, text: str) -> float | None:
        """Return the number in the range that a text of ASCII characters spells; None if it spells none."""
        if not text.isascii() or {*text} & {*"_ \t\r\n\v\f"}:
            return None
        try:
            value = self.kind(text)
        except ValueError:  # no number, or too many digits
            return None
        return value if value in self else None


SHARE: Final = Range(0.0, 1.0)
FACTOR: Final = Range(0.0, 1e6, above=True)
AMOUNT: Final = Range(0.0, 1e6)
COORDINATE: Final = Range(-1e9, 1e9)
SEED: Final = Range(0, 2**32 - 1)
STEPS: Final = Range(1, 1_000_000)  # of training
CLUSTER_SHARE: Final = Range(0.0, 1.0, above=True)
CLUSTER_SIZE: Final = Range(2, 100_000_000)
NEIGHBOURS: Final = Range(1, 128)  # that the kernels hold for each of millions of points
DECIBELS: Final = Range(0.0, 100.0, above=True)
FIELD_OF_VIEW: Final = Range(0.01, 179.0)  # degrees
TRACED_SIDE: Final = Range(16, 16384)  # of a ray-traced image, in pixels
PAIR_VIEWS: Final = Range(3, 10_000)  # of two, one is a test view, and a single training view fixes no positions
OFF_PATH: Final = Range(0, 10_000)  # views
SECONDS: Final = Range(0.0, 1e6, above=True)
CORES: Final = Range(1, 10_000)
MAX_GAUSSIANS: Final = Range(4, 100_000_000)  # of a model that grows; training starts from at least 4
VIEWS: Final = Range(1, 10_000)
SIDE: Final = Range(1, 65535)  # of an image, in pixels

Share = Annotated[float, SHARE]
Factor = Annotated[float, FACTOR]
Amount = Annotated[float, AMOUNT]
Steps = Annotated[int, STEPS]
MaxGaussians = Annotated[int, MAX_GAUSSIANS]
