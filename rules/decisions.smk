from gspure.constants import TAU_C, TAU_N
from gspure.workflow.decisions import METHOD, decisions, factors_of, origin, sweeps

# By scheme, every decision with all of its settings. Factors that are null are those that suit the scheme.
SUITED = {name: {"tau_c": scheme.tau_c, "tau_n": scheme.tau_n} for name, scheme in WATERMARKS.items()}
DECISIONS = {scheme: decisions(config, SUITED.get(scheme, {"tau_c": TAU_C, "tau_n": TAU_N})) for scheme in SCHEMES}

# Variants that are one attack at several strengths. Decisions differ between schemes in their factors alone.
SWEEPS = shlex.join(
    word
    for name, variants in sweeps(VARIANTS, DECISIONS["vanilla"]).items()
    for word in ("--sweep", f"{name}={','.join(variants)}")
)


wildcard_constraints:
    # The folder of a decision below that of its model; nothing for that of the method.
    decision=f"(?:|/decisions/(?:{'|'.join(config['decisions']) or 'none'}))",


def decision_of(wildcards):
    """The decision that a variant goes by, or that a folder is of."""
    if "variant" in wildcards.keys():
        return VARIANTS[wildcards.variant].get("decision", METHOD)
    return wildcards.get("decision", "").rpartition("/")[2] or METHOD


def settings_of(wildcards):
    """All settings of a decision."""
    return DECISIONS[wildcards.scheme][decision_of(wildcards)]


def made(artifact):
    """Where a decision finds an artifact: with the first one that has the same."""

    def path(wildcards):
        first = origin(DECISIONS[wildcards.scheme], decision_of(wildcards), artifact)
        folder = "" if first == METHOD else f"decisions/{first}"
        return os.path.join("results", wildcards.scheme, wildcards.scene, folder, artifact)

    return path


def indices(wildcards):
    """The indices of a decision's contributions, one for each part of the views."""
    return gather.views(f"{made('contributions')(wildcards)}/{{scatteritem}}.tsv")


def opacities(wildcards):
    """The opacities of a model's rows, whatever the decision."""
    return f"results/{wildcards.scheme}/{wildcards.scene}/opacities.npy"


def surface(wildcards):
    """The distances of a model's rows from the surface that it shows, whatever the decision."""
    return f"results/{wildcards.scheme}/{wildcards.scene}/surface.npy"


def decisive(wildcards):
    """What is thresholded: weights, or opacities where weights are not clustered on."""
    return (made("weights.npy") if "weight" in settings_of(wildcards)["cluster_on"] else opacities)(wildcards)


def method_options(*names):
    """Some settings of a decision, as options."""
    return lambda wildcards: options(settings_of(wildcards), *names)


def factor_points(wildcards):
    """The variants of a sweep of the pruning factors, that of the method first."""
    method = DECISIONS[wildcards.scheme][METHOD]
    points = factors_of(VARIANTS, DECISIONS[wildcards.scheme])
    ordered = sorted(points.items(), key=lambda point: point[1] != (method["tau_n"], method["tau_c"]))
    return shlex.join(word for name, (n, c) in ordered for word in ("--point", f"{name}={n},{c}"))


def is_swept(scheme):
    """Whether there are variants that differ from the method in one pruning factor alone."""
    method = DECISIONS[scheme][METHOD]
    points = factors_of(VARIANTS, DECISIONS[scheme]).values()
    return any((n == method["tau_n"]) != (c == method["tau_c"]) for n, c in points)


def scheme_figures():
    """The figures about all scenes of a scheme: those of the message where there is one, a sweep where there is one."""
    shown = [
        scheme
        for scheme, scenes in SCHEMES.items()
        if scheme != "vanilla" and any(get_finished(metrics_files(scheme, scene)) for scene in scenes)
    ]
    drawn = {scheme: ["sweep", "tradeoff"] if is_swept(scheme) else ["tradeoff"] for scheme in shown}
    return [f"results/figures/{scheme}/{name}.png" for scheme in shown for name in drawn[scheme]]
