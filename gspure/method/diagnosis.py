"""The effect of the clustering on pruning, with warnings."""

from dataclasses import asdict, dataclass
from typing import Any, SupportsFloat

import numpy as np
from numpy.typing import NDArray

from gspure.arrays import Bools
from gspure.constants import NOISE_LABEL, TAU_C, TAU_N
from gspure.errors import InputError
from gspure.method.pruning import plain_prune_mask, prune_mask
from gspure.method.weights import HELD_SHARE, LIGHT_FACTOR, few_in_view, heavy_rows, holding_rows
from gspure.model.finite import listed
from gspure.text import decimal, percent

_LARGEST_SHARE_WARNED = 0.5
CHANGED_SHARE_WARNED = 0.05


@dataclass(frozen=True)
class Diagnosis:
    """Statistics of a clustering and its pruning; shares are of all rows unless stated otherwise."""

    quantity: str  # that is compared with the thresholds: "weights" or "opacities"
    gaussians: int
    weighted: int  # rows of weight above 0
    clusters: int
    coincident: int  # surplus points in piles of equal features (`gspure.method.tree.coincident_points`)
    largest_share: float  # of the largest cluster
    noise_share: float
    pruned_share: float
    pruned_as_cluster: float
    pruned_as_noise: float
    pruned_weight_share: float  # of the pruned rows in the total weight
    holding: int  # number of the heaviest rows that hold `HELD_SHARE` of the total weight
    heavy: tuple[int, ...]  # rows of `gspure.method.weights.heavy_rows`
    heavy_weight_share: float  # of these in the total weight
    plain_share: float  # pruned by the rule without clustering, ω_k < ω̄/τ_n
    changed_share: float  # one minus the Jaccard index of the pruned sets with and without clustering
    changed_share_clustered: float  # the same among clustered points (both rules agree on noise)

    @property
    def _total(self) -> str:
        return "all ω" if self.quantity == "weights" else "all opacities"

    @property
    def warnings(self) -> tuple[str, ...]:
        """Reasons to doubt the clustering, one sentence each."""
        sentences = few_in_view(self.weighted, self.gaussians) if self.quantity == "weights" else []
        if self.largest_share > _LARGEST_SHARE_WARNED:
            sentences.append(
                f"the largest cluster holds {percent(self.largest_share, 0)} of all rows: "
                "the clustering has collapsed; try selection eom_capped or leaf"
            )
        if self.pruned_share == 1:
            sentences.append("every row is pruned: nothing remains to be written; larger factors prune less")
        if not self.clusters:
            sentences.append("there is no cluster: the noise rule applies to every row")
        elif self.changed_share < CHANGED_SHARE_WARNED:
            sentences.append(
                "clustering changes little: the rule without it prunes nearly the same rows "
                f"({percent(self.changed_share)} differ)"
            )
        if self.coincident and self.clusters:
            sentences.append(
                f"{self.coincident} rows have the same features as more than min_samples others: "
                "such piles are infinitely dense, so each pile of at least min_cluster_size rows becomes a cluster "
                "or, if it exceeds max_cluster_share, noise"
            )
        if self.gaussians > LIGHT_FACTOR * self.holding:
            factor = decimal(self.gaussians / self.holding, 0)
            sentences.append(
                f"{self.holding} of {self.gaussians} rows hold {percent(HELD_SHARE, 0)} of {self._total}: "
                f"the others lower the thresholds by a factor of up to {factor}, "
                f"so fewer of the {self.holding} are pruned"
            )
        if self.heavy:
            share = percent(self.heavy_weight_share, 0)
            sentences.append(
                f"{len(self.heavy)} of {self.gaussians} rows hold {share} of {self._total} ({listed(self.heavy)}): "
                f"they raise the thresholds and compress the {self.quantity} of all others"
            )
        return tuple(sentences)

    def lines(self) -> list[str]:
        """Return the pruned rows and the clusters as lines of text."""
        pruned_rows = f"{percent(self.pruned_share)} of {self.gaussians:,} rows"
        table = {
            "pruned": f"{pruned_rows}, {percent(self.pruned_weight_share, 2)} of {self._total}",
            "clusters": f"{self.clusters} (largest {percent(self.largest_share)}, noise {percent(self.noise_share)})",
        }
        return [f"{name:<16}  {text}" for name, text in table.items()]

    def to_json(self) -> dict[str, Any]:
        """Return the diagnosis as numbers, strings and lists of them."""
        return {**asdict(self), "heavy": list(self.heavy), "warnings": list(self.warnings)}


def diagnose(
    labels: NDArray[Any],
    weights: NDArray[Any],
    tau_c: float = TAU_C,
    tau_n: float = TAU_N,
    coincident: int = 0,
    quantity: str = "weights",
) -> Diagnosis:
    """Compare pruning by clusters with the rule without clustering.

    `labels` [K] are -1 for noise. `weights` [K] hold the `quantity`, "weights" or "opacities". `coincident` is the
    number of `gspure.method.tree.coincident_points`. Raise `InputError` if labels and weights differ in number.
    """
    if len(labels) != len(weights):
        raise InputError("clustering", "labels", expected=f"{len(weights)}, as many as weights", found=str(len(labels)))
    pruned = prune_mask(labels, weights, tau_c, tau_n)
    plain = plain_prune_mask(weights, tau_n)
    clustered = labels != NOISE_LABEL
    heavy = heavy_rows(weights)
    sizes = np.bincount(labels[clustered])
    return Diagnosis(
        quantity=quantity,
        gaussians=len(labels),
        weighted=int(np.count_nonzero(weights)),
        clusters=len(sizes),
        coincident=coincident,
        largest_share=_share(sizes.max(initial=0), len(labels)),
        noise_share=_share((~clustered).sum(), len(labels)),
        pruned_share=_share(pruned.sum(), len(labels)),
        pruned_as_cluster=_share((pruned & clustered).sum(), len(labels)),
        pruned_as_noise=_share((pruned & ~clustered).sum(), len(labels)),
        pruned_weight_share=_share(weights[pruned].sum(dtype=np.float64), weights.sum(dtype=np.float64)),
        holding=holding_rows(weights),
        heavy=tuple(heavy.tolist()),
        heavy_weight_share=_share(weights[heavy].sum(dtype=np.float64), weights.sum(dtype=np.float64)),
        plain_share=_share(plain.sum(), len(labels)),
        changed_share=_changed(pruned, plain),
        changed_share_clustered=_changed(pruned[clustered], plain[clustered]),
    )


def _changed(a: Bools, b: Bools) -> float:
    return _share((a ^ b).sum(), (a | b).sum())


def _share(part: SupportsFloat, whole: SupportsFloat) -> float:
    return float(part) / float(whole) if whole else 0.0
