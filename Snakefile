# gspure: how robust is a 3D Gaussian Splatting watermark?
#
#   snakemake                              the demo: config/config.yaml
#   snakemake --configfile mine.yaml       your own models: see config/README.md

from pathlib import Path
from snakemake.utils import min_version

min_version("9.27")

# A configuration of one's own replaces the demo's; it is not laid over it.
if not (workflow.configfiles or {"assets", "pairs"} & config.keys()):

    configfile: Path(workflow.basedir) / "config" / "config.yaml"


report: "rules/report/workflow.rst"


# Reads the configuration and makes the plan; the rules name jobs of it. Their functions of wildcards are called later, when
# Snakemake builds the graph of jobs.
include: "rules/common.smk"
include: "rules/base.smk"
include: "rules/models.smk"
include: "rules/method.smk"
include: "rules/evaluation.smk"


rule all:
    default_target: True
    input:
        REPORTED,  # a report without a failed variant is no reason to leave that out again
        page="results/report.html",
    message:
        "Done: see {input.page}"


rule purified:
    input:
        expand("results/{model}/gspure/public", model=MODELS),
    message:
        "Purified models only"


onstart:
    start()


# The tables and the report of what there is, with the reasons for what is missing.
onerror:
    shell("python -m gspure report results >&2 || true")
