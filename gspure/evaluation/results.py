"""The table ``results.csv``: one row for each model, variant and owner, from which radii and reports follow."""

from collections.abc import Iterable, Mapping, Sequence
from math import isnan, nan
from pathlib import Path
from types import MappingProxyType
from typing import Annotated, Final, Literal, NamedTuple

from gspure.evaluation.attack_record import StrengthValue
from gspure.evaluation.identity import ModelId, OfCondition
from gspure.metrics.csv_tables import read_table, write_table
from gspure.metrics.names import UNATTACKED, is_control, variant_title
from gspure.metrics.proof import COARSEST

PUBLISHED: Final = "published"  # the owner who extracts exactly as the scheme's authors do
ADAPTS: Final = "adaptive"  # the owner who adapts to the attack, and is never worse than as published

OwnerName = Literal["published", "adaptive", ""]

READABLE: Final = "readable"  # proven, and a person or a program reads all of it
TRACES: Final = "traces"  # proven, and a part of it can be recognized
PROVEN: Final = "proven"  # proven, but nothing of it can be recognized
KEY_ONLY: Final = "key-only"  # gone: what the extraction shows comes from the key, not from the file
GONE: Final = "gone"  # nothing of the above
Word = Literal["readable", "traces", "proven", "key-only", "gone", ""]

IN_ORDER: Final[tuple[Word, ...]] = (READABLE, TRACES, PROVEN, KEY_ONLY, GONE)

_NONE: Final[Mapping[str, float]] = MappingProxyType({})


class Result(NamedTuple):
    """One variant or control of a model, as one owner reads it; unknown numbers are NaN or None, and empty in the file.

    Without a message, there is one row, of no owner. A variant without results has only the reason.

    Parameters
    ----------
    condition
        Columns `scheme`, `protocol` and `initialization`.
    scene, seed
        The model; seeds from 1 on are repetitions.
    variant, entry, attack
        The variant, its entry in the configuration, and the attack that it is one strength of.
    wanted, strength
        The damage for which the strength was searched, dB; columns `strength_setting` and `strength_value`.
    owner, extraction
        ``published`` or ``adaptive``; the extraction that shows the message, or a detector.
    damage, fidelity
        Drop of the scene's PSNR against photographs that a customer cannot undo, dB; without photographs, PSNR of the
        scene against renders of the unattacked model.
    coverage_lost
        Share of the pixels that the attack uncovers.
    scene_values, message_values
        Columns `scene_METRIC` and `message_METRIC`.
    trace, legibility, word
        T, R, and what is left of the message.
    z, p, level
        Standard score of T among the candidates; the p-value; the largest one that proves the message.
    candidates, clean_models, twins, bits
        Their numbers.
    reading, correct
        What a detector reads, mean over views: correct bits in percent, or a score; bits that most views read right.
    reached
        Whether the attack changed what the extraction reads.
    pruned_share
        Share of the rows that the attack removed.
    failure, run
        Why results are missing; run ID.

    """

    condition: OfCondition
    scene: str
    seed: int
    variant: str
    entry: str = ""
    attack: str = ""
    wanted: float = nan
    strength: StrengthValue | None = None
    owner: OwnerName = ""
    extraction: str = ""
    damage: float = nan
    fidelity: float = nan
    coverage_lost: float = nan
    scene_values: Annotated[Mapping[str, float], "scene_{}"] = _NONE
    message_values: Annotated[Mapping[str, float], "message_{}"] = _NONE
    trace: float = nan
    legibility: float = nan
    z: float = nan
    p: float = nan
    level: float = nan
    candidates: int = 0
    clean_models: int = 0
    twins: int = 0
    reading: float = nan
    correct: int = 0
    bits: int = 0
    word: Word = ""
    reached: bool | None = None
    pruned_share: float = nan
    failure: str = ""
    run: str = ""

    @property
    def model(self) -> ModelId:
        """Its model."""
        return ModelId(self.condition.scheme, self.scene, self.seed)

    @property
    def title(self) -> str:
        """The display name of the variant."""
        return variant_title(self.entry or self.variant, self.wanted)

    @property
    def is_attack(self) -> bool:
        """Whether it is an attacked model, neither a control nor the unattacked one."""
        return not is_control(self.variant) and self.variant != UNATTACKED

    @property
    def is_decided(self) -> bool:
        """Whether a proof is possible: there are enough candidates or bits for a significant level."""
        return bool(self.word) and not self.level > COARSEST

    @property
    def is_proven(self) -> bool:
        """Whether the message is proven, or without candidates, when no proof is possible, recognized."""
        return self.word in (READABLE, TRACES, PROVEN)


def write_results(path: Path, rows: Iterable[Result]) -> None:
    """Write the rows, whole or not at all; unknown numbers are empty."""
    write_table(path, Result, rows)


def read_results(*paths: Path) -> list[Result]:
    """Read tables of `write_results`, or raise `InputError`."""
    return [row for path in paths for row in read_table(path, Result)]


def better(words: Sequence[Word]) -> Word:
    """Return the word that says most about the message."""
    return min((word for word in words if word), key=IN_ORDER.index, default="")


def known_cells(rows: Iterable[Result], field: str) -> dict[tuple[str, int], float]:
    """Return a number of the rows by scene and seed, where it is known."""
    values = {(row.scene, row.seed): float(getattr(row, field)) for row in rows}
    return {cell: value for cell, value in values.items() if not isnan(value)}
