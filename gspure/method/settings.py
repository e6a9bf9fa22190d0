"""The settings of GSPure, as configurations and plans hold them."""

from dataclasses import dataclass
from typing import Annotated, Any, Final, Literal

from gspure.constants import MAX_CLUSTER_SHARE, MIN_CLUSTER_SIZE, MIN_SAMPLES, TAU_C, TAU_N, Energy
from gspure.method.clusters import Selection
from gspure.method.weights import Reduction
from gspure.settings import CLUSTER_SHARE, CLUSTER_SIZE, FACTOR, NEIGHBOURS, VIEWS

Feature = Literal["position", "opacity", "weight"]
FEATURES: Final[tuple[Feature, ...]] = ("position", "opacity", "weight")


@dataclass(frozen=True)
class ClusterSettings:
    """The selection of clusters from a spanning tree."""

    min_cluster_size: int
    selection: Selection
    max_cluster_share: float


@dataclass(frozen=True)
class PruningFactors:
    """The pruning factors of clusters and of noise."""

    tau_c: float
    tau_n: float


@dataclass(frozen=True)
class MethodSettings:
    """One decision of GSPure. Pruning factors that are None suit the scheme (`suited`)."""

    cluster_on: Annotated[
        tuple[Feature, ...],
        "Features to cluster on. Without `weight`, pruning uses opacities in place of weights.",
    ] = FEATURES
    energy: Annotated[
        Energy,
        "Value of a Gaussian at a pixel when contributions are measured: its maximum along the pixel's ray (ray, the "
        "paper's equation) or its 2-D splat (ewa, as in vanilla rendering). center_ray: as ray, on one ray per "
        "Gaussian and view, through the centre, instead of one per pixel.",
    ] = "ray"
    reduction: Annotated[Reduction, "Reduction of the pixels of one view to one contribution."] = "sum"
    views: Annotated[
        Annotated[int, VIEWS] | None,
        "Number of training views to average contributions over, evenly spread; null means all.",
    ] = None
    min_samples: Annotated[int, NEIGHBOURS, "HDBSCAN's min_samples."] = MIN_SAMPLES
    min_cluster_size: Annotated[int, CLUSTER_SIZE, "HDBSCAN's min_cluster_size."] = MIN_CLUSTER_SIZE
    selection: Annotated[
        Selection,
        "Selection of clusters from HDBSCAN's hierarchy: excess of mass without clusters above max_cluster_share, "
        "plain excess of mass, or leaves.",
    ] = "eom_capped"
    max_cluster_share: Annotated[
        float, CLUSTER_SHARE, "Largest share of the Gaussians in one cluster (eom_capped only)."
    ] = MAX_CLUSTER_SHARE
    tau_c: Annotated[
        Annotated[float, FACTOR] | None,
        "A cluster is pruned if its mean weight is below the mean weight of all Gaussians divided by tau_c. By "
        "default the paper's value for the scheme: 3 for secure_gs, 4 for all others and for `assets`; set 3 for "
        "assets of anchors.",
    ] = None
    tau_n: Annotated[
        Annotated[float, FACTOR] | None,
        "A noise point is pruned if its weight is below the mean weight divided by tau_n. By default the paper's "
        "value for the scheme: 2 for secure_gs, 4 for all others and for `assets`; set 2 for assets of anchors.",
    ] = None

    @property
    def selecting(self) -> ClusterSettings:
        """The selection of clusters."""
        return ClusterSettings(self.min_cluster_size, self.selection, self.max_cluster_share)

    @property
    def factors(self) -> PruningFactors:
        """The pruning factors, by default those of the paper for Gaussians."""
        return PruningFactors(self.tau_c or TAU_C, self.tau_n or TAU_N)

    @property
    def prunes_by_weight(self) -> bool:
        """Whether the pruning factors apply to weights; else to opacities."""
        return "weight" in self.cluster_on

    @property
    def of_purify(self) -> dict[str, Any]:
        """The settings that `gspure.method.purify.purify` takes; the views are chosen before, features are all."""
        names = ("energy", "reduction", "min_samples", "min_cluster_size", "selection", "max_cluster_share")
        return {name: getattr(self, name) for name in (*names, "tau_c", "tau_n")}
