"""Networks beside a public model: attacks copy them byte for byte, and ambiguous ones are warned of."""

import zipfile
from pathlib import Path

import numpy as np
import pytest

from gspure.cli import main
from gspure.model import Gaussians
from gspure.schemes import secure_gs
from gspure.schemes.gs_hider.model import COLUMNS, DecoderFile, FeatureModel
from tests.anchor_cases import random_public

ROWS = Gaussians(np.ones(5, [(name, "<f4") for name in COLUMNS]))
MODELS = {
    "gs_hider": lambda: FeatureModel(ROWS, DecoderFile(Path("chkpnt7_net.pth"), b"\7")),
    "secure_gs": random_public,
}
NETWORKS = {"gs_hider": "chkpnt7_net.pth", "secure_gs": "checkpoints.pth"}


@pytest.mark.parametrize("scheme", MODELS)
def test_attacked_models_have_the_networks_byte_for_byte(tmp_path, scheme):
    MODELS[scheme]().write(tmp_path / "public" / "point_cloud.ply")
    network = tmp_path / "public" / NETWORKS[scheme]
    if zipfile.is_zipfile(network):
        with zipfile.ZipFile(network, "a") as archive:
            archive.comment = b"of another writer"
    out = tmp_path / "attacked" / "point_cloud.ply"
    assert main(["attack", "random_pruning", "--model", str(network.parent), "--out", str(out)]) == 0
    assert out.with_name(network.name).read_bytes() == network.read_bytes()


def test_networks_in_two_formats_are_warned_of(tmp_path, capsys):
    random_public().write(tmp_path / "point_cloud.ply")
    (tmp_path / "color_mlp.pt").touch()
    secure_gs.SCHEME.read_public(tmp_path)
    assert "checkpoints.pth is used" in capsys.readouterr().err
