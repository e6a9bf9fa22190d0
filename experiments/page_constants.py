"""The constants that the pages name: the text around them, where ``#`` stands for each, and what the code says.

A test compares them with the pages: unlike the measured numbers of `page_numbers`, they are exact.
"""

import re
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from experiments import free_attacks, scan
from gspure import constants
from gspure.attacks import pruning
from gspure.attacks.strength import EVALUATIONS
from gspure.cli.audit import LOST
from gspure.images import MOST_PIXELS
from gspure.method import diagnosis, features
from gspure.method.weights import HEAVY_SHARE
from gspure.metrics import legibility, proof
from gspure.metrics.detection import FALSE_POSITIVES
from gspure.metrics.image_metrics import DAMAGE_TOLERANCE
from gspure.metrics.sign_ranks import KEYS
from gspure.metrics.statistics import LEVEL
from gspure.model.compressed import CHUNK
from gspure.model.summary import BULK
from gspure.opencl.losses import SSIM_WEIGHT
from gspure.renderer import CONTRIBUTION
from gspure.report.audit import BROKEN, WEAK
from gspure.schemes import matching
from gspure.schemes.keyed_pattern import pattern, registration
from gspure.schemes.registry import find_scheme
from gspure.schemes.scheme import FIT_STEPS
from gspure.schemes.splats_in_splats.bits import SHIFT
from gspure.surface import meshing
from gspure.training import dataset, densification, fast, initialization, schedule
from gspure_torch import reference
from gspure_torch.keyss import network
from gspure_torch.secure_gs.initialization import GAUSSIANS_PER_ANCHOR

ROOT = Path(__file__).parents[1]


def number_after(text: str, path: str) -> float:
    """Return the number that follows a text in a file that cannot be imported without more, such as a kernel."""
    source = (ROOT / path).read_text(encoding="utf-8")
    numbers = re.findall(re.escape(text) + r" ([\d_.]+)f?(?=[,)]|\s*(?:#|//|$))", source, re.MULTILINE)
    if len(numbers) != 1:
        raise ValueError(f"{path}: {len(numbers)} numbers after {text!r}")
    return float(numbers[0])


def setting(scheme: str, name: str) -> float:
    """Return the default of a setting of a scheme."""
    return float(find_scheme(scheme).settings[name])


def yaml_of(path: str) -> Any:
    """Return the content of a YAML file of the repository."""
    return yaml.safe_load((ROOT / path).read_text(encoding="utf-8"))


def cluster_resources() -> list[float]:
    """Return the least and the largest memory, GB, and time, h, of device jobs on a cluster, then those of others."""
    profile = yaml_of("profiles/slurm/config.yaml")
    numbers = []
    for resource, unit in (("mem_mb", 1000), ("runtime", 60)):
        amounts = [rule[resource] / unit for rule in profile["set-resources"].values()]
        numbers += [min(amounts), max(amounts)]
    default = profile["default-resources"]
    return [*numbers, default["mem_mb"] / 1000, default["runtime"] / 60]


def survival_of(*names: str) -> list[float]:
    """Return the distinct values of these settings in the runs on marks that survive."""
    runs = [yaml_of(f"experiments/{run}.yaml") for run in ("survival", "survival_weaker")]
    defaults = find_scheme("keyed_pattern").settings
    settings = [
        {**defaults, **run["schemes"]["keyed_pattern"], **pair} for run in runs for pair in run["pairs"].values()
    ]
    found: list[float] = []
    for name in names:
        found += dict.fromkeys(float(each[name]) for each in settings)
    return found


def taus(*schemes: str) -> list[float]:
    """Return the pruning factors of noise and of clusters that schemes share."""
    ((tau_n, tau_c),) = {(scheme.tau_n, scheme.tau_c) for scheme in map(find_scheme, schemes)}
    return [tau_n, tau_c]


FLOAT = 4  # bytes
NUMBERS_OF_COLOUR = 3 * (constants.MAX_SH_DEGREE + 1) ** 2
NUMBERS_OF_GAUSSIAN = constants.GEOMETRY_ATTRIBUTES + NUMBERS_OF_COLOUR
CUT_OFF = 1 / constants.ALPHA_MIN
ROTATIONS = registration.STARTS + 3 * registration.TURNS
STEPS_OF_PROGRAMS = number_after("\nITERATIONS =", "experiments/programs.py")
HARDENED = {setting(f"{scheme}_hardened", "hardened") for scheme in ("splats_in_splats", "gs_hider", "secure_gs")}

CONSTANTS: dict[str, dict[str, list[float]]] = {
    "README.md": {
        "exit-status) #. `gspure embed": [LOST],
    },
    "benchmarks/README.md": {
        "random reads of # bytes per visible": [FLOAT * constants.FOOTPRINT_FLOATS],
        "memory: # bytes per Gaussian, # of them colours": [FLOAT * NUMBERS_OF_GAUSSIAN, FLOAT * NUMBERS_OF_COLOUR],
        "per Gaussian, every step reads # bytes": [FLOAT * NUMBERS_OF_GAUSSIAN],
        "instructions per row of # pixels": [constants.TILE],
    },
    "config/README.md": {
        "caches contributions, # bytes per Gaussian and view": [CONTRIBUTION.itemsize],
        "over strengths, with # [candidates]": [
            yaml_of("gspure/workflow/suites/standard-1.yaml")["proof"]["candidates"]
        ],
    },
    "docs/ablations.md": {
        "`eom_capped`, `min_samples` #, `min_cluster_size` #.": [constants.MIN_SAMPLES, constants.MIN_CLUSTER_SIZE],
    },
    "docs/architecture.md": {
        "into tiles of #×# pixels": [constants.TILE, constants.TILE],
        "processes a tile in rows of # pixels": [constants.TILE],
        "a work-group of # does": [constants.TILE**2],
    },
    "docs/attacks.md": {
        "The search renders at most # attacked models": [EVALUATIONS + 1],
        "at most # dB above it": [DAMAGE_TOLERANCE],
        "default, #, matches GOF's boxes": [pruning.TOLERANCE],
        "= #$ standard deviations in front": [round(np.sqrt(-2 * np.log(meshing.LEVEL)), 2)],
        "for more than # Gaussians of an opacity above #, the surface": [
            number_after("MOST_OPAQUE =", "rules/steps/surface.py"),
            meshing.OPAQUE,
        ],
        "where α crosses 1/# or two": [CUT_OFF],
        "Over # seeds of `gauge`": [free_attacks.SEEDS],
    },
    "docs/cluster.md": {
        "# to # GB and # to # h; all others a CPU, # GB and # h.": cluster_resources(),
        "of the configuration, or # (1 for": [number_after("subject.has_small_images else", "rules/common.smk")],
    },
    "docs/cuda-free.md": {
        "unchanged, after # steps": [STEPS_OF_PROGRAMS],
        "scales its schedule to the # iterations": [STEPS_OF_PROGRAMS],
        "After # of the # steps of INRIA's": [STEPS_OF_PROGRAMS, schedule.ITERATIONS],
    },
    "docs/formats.md": {
        "(colour = 0.5 + # ·": [round(constants.SH_DC, 4)],
        "A compressed PLY stores # rows at a time": [CHUNK],
        "per channel and at most 2^# pixels": [np.log2(MOST_PIXELS)],
    },
    "docs/gradients.md": {
        r"$\lambda = #$": [SSIM_WEIGHT],
        r"f_i f_i^\top + #\,I$": [constants.EWA_DILATION],
        "is clamped, below 1/#, or behind": [CUT_OFF],
    },
    "docs/marks-that-survive.md": {
        "Six ray-traced scenes (#x#, # rows, # bits": survival_of("width", "height", "max_gaussians", "bits"),
        "embedding may cost # in training views (three scenes: #).": survival_of("message_weight"),
    },
    "docs/method.md": {
        "`min_samples` is # and `min_cluster_size` #.": [constants.MIN_SAMPLES, constants.MIN_CLUSTER_SIZE],
        "`max_cluster_share` (#)": [constants.MAX_CLUSTER_SHARE],
        r"$(\tau_n, \tau_c)$ is (#, #) for": taus("splats_in_splats", "gs_hider"),
        "and (#, #) for SecureGS. **O** Otherwise (#, #).": [*taus("secure_gs"), constants.TAU_N, constants.TAU_C],
        "clustering changes less than # % of": [100 * diagnosis.CHANGED_SHARE_WARNED],
        "each row with more than # % of all weight": [100 * HEAVY_SHARE],
        "Outlying rows are over # extents": [features.OUTLYING],
        "between their # % and # % quantiles": [100 * share for share in BULK],
        "their features are clipped to ±#.": [features.LARGEST],
    },
    "docs/numerics.md": {
        r"\min(#,~o E)$, and 0 where that is below 1/#.": [constants.ALPHA_MAX, CUT_OFF],
        r"\Sigma_c\,J^\top + #\,I": [constants.EWA_DILATION],
        "widened by # of its half extent": [constants.EWA_FRUSTUM_MARGIN],
        r"T - w < #: \text{ stop": [constants.TRANSMITTANCE_MIN],
        "spherical harmonics of degree 0 to #": [constants.MAX_SH_DEGREE],
        "at which $T$ falls to # or": [constants.MEDIAN_TRANSMITTANCE],
        r"whose region $\alpha \ge 1/#$": [CUT_OFF],
        "widened by # px for rounding": [number_after("#else\n#define FOOTPRINT_MARGIN", "kernels_cl/layout.cl")],
        "The near plane is #, as in 3DGS": [constants.NEAR_PLANE],
    },
    "docs/scan.md": {
        "together flag at most # % of": [100 * scan.RATE],
    },
    "docs/schemes.md": {
        "in the low # bits (`shift`)": [SHIFT],
        "and loss weight (#) are": [setting("gs_hider", "message_weight")],
        "compute # Gaussians per anchor": [GAUSSIANS_PER_ANCHOR],
        "reads it with the # numbers of a Gaussian": [network.ROW],
        "falls from # to zero": [network.RATE],
        "(within # of the model's extent)": [matching.NEAR],
        "one of the # nearest rows of the key": [matching.NEIGHBOURS],
        "explains at least # % of their change": [100 * (1 - matching.MIXED)],
        "private networks for # steps": [FIT_STEPS],
        "with `tau` = `hardened` (#) would": [*HARDENED],
        "their keys hold # public rows": [reference.ROWS],
        "into cells, # along the radius that holds # % of the rows": [pattern.PER_RADIUS, 100 * pattern.INNER],
        "`message_weight` dB (#).": [setting("keyed_pattern", "message_weight")],
        "closest points from # rotations": [ROTATIONS],
    },
    "docs/statistics.md": {
        "below # pixels, it has fewer scales": [constants.SSIM_WINDOW * 2 ** (len(constants.MS_SSIM_WEIGHTS) - 1)],
        "The level** is # or, with fewer than # candidates": [proof.SIGNIFICANCE, 1 / proof.SIGNIFICANCE - 1],
        "if that exceeds #, nothing is proven": [proof.COARSEST],
        "correlates with the message's by at least #. Of # × # blocks": [
            legibility.MATCH,
            *reversed(legibility.BLOCKS),
        ],
        r"proven and $R \ge #$; of bits": [legibility.READABLE],
        r"**traces**: proven and $R \ge #$": [legibility.TRACES],
        r"*key-only* is $R \ge #$": [legibility.TRACES],
        "The level is #, or $2^{-n}$ if larger": [proof.SIGNIFICANCE],
        "among those of # random keys": [KEYS],
        "exceed a threshold that # % of": [100 * FALSE_POSITIVES],
        "*broken* up to # dB, *weak* up to # dB": [BROKEN, WEAK],
        "and none cost # dB or more": [BROKEN],
        "**Intervals** (# %": [100 * LEVEL],
    },
    "docs/training.md": {
        "Gaussian of opacity # at each": [initialization.OPACITY],
        "# · L1 + # · (1 − SSIM)": [1 - SSIM_WEIGHT, SSIM_WEIGHT],
        "every # of # steps (1);": [schedule.SH_EVERY, schedule.ITERATIONS],
        "densification after # steps (#), every # (#), until #;": [
            schedule.DENSIFY_FROM,
            schedule.LEAST_FROM,
            schedule.DENSIFY_EVERY,
            schedule.LEAST_EVERY,
            schedule.DENSIFY_UNTIL,
        ],
        "opacities every # steps (#).": [schedule.RESET_EVERY, schedule.LEAST_RESET],
        "log-linearly from # to # of the *extent*, # times": [*schedule.MEANS_RATES, dataset.EXTENT_MARGIN],
        "quaternions #, logarithms of scales #, logits of opacity #, colours #": [
            schedule.QUATS_RATE,
            schedule.SCALES_RATE,
            schedule.OPACITIES_RATE,
            schedule.SH_DC_RATE,
        ],
        "weighs SSIM by # instead of #.": [fast.SSIM_OF_PHOTOGRAPHS, SSIM_WEIGHT],
        "where this mean is at least #.": [densification.GRADIENT_THRESHOLD],
        "largest scale is at most # % of": [100 * densification.DENSE_SHARE],
        "with scales divided by #.": [densification.SPLIT_SHRINK],
        "**Prune** opacities below #; after the first reset also scales above # % of": [
            densification.OPACITY_MIN,
            100 * densification.BIG_SHARE,
        ],
        "**reset** opacities to at most #,": [densification.RESET_OPACITY],
        "training starts from # random ones": [initialization.RANDOM_POINTS],
    },
}
