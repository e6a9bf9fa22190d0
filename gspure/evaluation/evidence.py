"""The evidence that a job collects: how well each extraction shows the message, and how well it shows others."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Final

from gspure.arrays import Float32, UInt8
from gspure.images import is_blank
from gspure.metrics.bit_evidence import BitEvidence
from gspure.metrics.legibility import legibility
from gspure.metrics.proof import compared_views, trace, traces

EVIDENCE: Final = "evidence.json"  # file of a variant or control


@dataclass(frozen=True)
class Evidence:
    """One extraction of one model.

    Traces are correlations with the message, -1 to 1 (`gspure.metrics.proof.trace`); those of `candidates` are the
    extraction's with pictures of the message's kind, those of `twins` are of models whose carriers were drawn again.
    """

    trace: float
    legibility: float  # share of the message's blocks that can be recognized, 0 to 1
    candidates: tuple[float, ...] = ()
    twins: tuple[float, ...] = ()
    is_blank: bool = False  # whether no view shows anything
    is_fitted: bool = False  # whether the key learned from photographs of the message


@dataclass(frozen=True)
class SceneChange:
    """What an attack does to the scene (`gspure.metrics.damage`); damage needs photographs."""

    damage: float | None  # dB
    fidelity: float | None  # dB; None if nothing changed
    coverage_lost: float  # share of the pixels


@dataclass(frozen=True)
class JobEvidence:
    """The content of `EVIDENCE`: the change of the scene, and evidence by extraction and by detector of bits."""

    scene: SceneChange | None = None  # None for a control
    pictures: Mapping[str, Evidence] = field(default_factory=dict)
    bits: Mapping[str, BitEvidence] = field(default_factory=dict)


def evidence_of(
    extractions: Sequence[Float32],
    messages: Sequence[Float32],
    candidates: UInt8 | None,
    twins: Sequence[float] = (),
    *,
    is_fitted: bool = False,
) -> Evidence:
    """Return the evidence in some views; traces are those of the `compared_views`.

    Parameters
    ----------
    extractions, messages : sequence of [H,W,3]
        What the extraction shows, and the photographs of the message, 0 to 1, view by view.
    candidates : [N,V,H/2,W/2,3], optional
        Pictures of the message's kind in the V compared views, at half size.
    twins : sequence of float
        Traces of models whose carriers were drawn again.
    is_fitted : bool
        Whether the key learned from photographs of the message.

    """
    views = compared_views(len(messages))
    shown = [extractions[view] for view in views]
    candidate_traces = () if candidates is None else tuple(traces(shown, candidates).tolist())
    return Evidence(
        trace=trace(shown, [messages[view] for view in views]),
        legibility=legibility(extractions, messages),
        candidates=candidate_traces,
        twins=tuple(twins),
        is_blank=all(map(is_blank, extractions)),
        is_fitted=is_fitted,
    )
