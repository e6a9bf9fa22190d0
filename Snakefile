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


report: "report/workflow.rst"


include: "rules/common.smk"
include: "rules/progress.smk"
include: "rules/failures.smk"
include: "rules/notes.smk"
include: "rules/requirements.smk"
include: "rules/scenes.smk"
include: "rules/train.smk"
include: "rules/embed.smk"
include: "rules/contributions.smk"
include: "rules/purify.smk"
include: "rules/surface.smk"
include: "rules/attack.smk"
include: "rules/evaluate.smk"
include: "rules/compare.smk"
include: "rules/figures.smk"
include: "rules/report.smk"


rule all:
    default_target: True
    input:
        "results/report.html",
    message:
        "Done: see {input}"


rule purified:
    input:
        expand("results/{model}/gspure/public/point_cloud.ply", model=MODELS),
    message:
        "Purified models only"
