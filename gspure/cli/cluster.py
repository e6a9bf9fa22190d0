"""``gspure cluster``: flat clusters from a spanning tree."""

from gspure.artifacts import write_record
from gspure.cli.parser import Arguments, Parser
from gspure.constants import MAX_CLUSTER_SHARE, MIN_CLUSTER_SIZE
from gspure.method.clusters import SELECTIONS, Clusters, select, write_clusters
from gspure.method.tree import coincident_points, read_tree
from gspure.settings import CLUSTER_SHARE, CLUSTER_SIZE

EXAMPLES = """\
  gspure cluster --tree tree.npy --out clusters.npz
  gspure cluster --tree tree.npy --selection leaf --min-cluster-size 100 --out leaves.npz
"""


def add_arguments(parser: Parser) -> None:
    parser.reads("--tree", "NPY", "tree, from `gspure tree`")
    add_selection(parser)
    parser.writes("--out", "NPZ", "labels: int32 [K], -1 is noise")


def run(args: Arguments) -> None:
    tree = read_tree(args.tree)
    settings = {name: getattr(args, name) for name in ("min_cluster_size", "selection", "max_cluster_share")}
    write_clusters(args.out, Clusters(select(tree, **settings), coincident_points(tree)), settings)
    write_record(args.out, inputs={"tree": args.tree}, settings=settings, kind="labels")


def add_selection(parser: Parser) -> None:
    """Add ``--min-cluster-size``, ``--selection`` and ``--max-cluster-share``."""
    parser.number("--min-cluster-size", "N", "HDBSCAN's min_cluster_size", CLUSTER_SIZE, MIN_CLUSTER_SIZE)
    parser.choice(
        "--selection",
        SELECTIONS,
        "eom_capped, eom: HDBSCAN's excess of mass with and without --max-cluster-share; leaf: the leaves "
        "of its hierarchy",
        SELECTIONS[0],
    )
    parser.number(
        "--max-cluster-share",
        "SHARE",
        "for eom_capped: largest share of the Gaussians in one cluster",
        CLUSTER_SHARE,
        MAX_CLUSTER_SHARE,
    )
