"""Networks beside a public model: read, refused, never executed, and copied byte for byte by attacks."""

import pickle
import zipfile
from pathlib import Path

import numpy as np
import pytest

from gspure.cli import main
from gspure.errors import InputError
from gspure.model import Gaussians, write_model
from gspure_torch.gs_hider.model import COLUMNS, DecoderFile, FeatureModel
from gspure_torch.secure_gs.model import NETWORKS, AnchorModel, write_networks
from tests.anchor_cases import random_public

ROWS = Gaussians(np.ones(5, [(name, "<f4") for name in COLUMNS]))
MODELS = {
    "chkpnt7_net.pth": lambda: FeatureModel(ROWS, DecoderFile(Path("chkpnt7_net.pth"), b"\7")),
    NETWORKS: random_public,
}


@pytest.mark.parametrize("network", MODELS)
def test_attacked_models_have_the_networks_byte_for_byte(tmp_path, network):
    MODELS[network]().write(tmp_path / "public" / "point_cloud.ply")
    out = tmp_path / "attacked" / "point_cloud.ply"
    assert main(["attack", "random_pruning", "--model", str(tmp_path / "public"), "--out", str(out)]) == 0
    assert out.with_name(network).read_bytes() == (tmp_path / "public" / network).read_bytes()


def test_the_official_table_loads_with_offsets_by_coordinate(tmp_path):
    counted = {"f_offset": 30, "f_anchor_feat": 32, "scale": 6, "rot": 4}
    names = ["x", "y", "z", "opacity"] + [f"{name}_{i}" for name in counted for i in range(counted[name])]
    table = np.ones(5, [(name, "<f4") for name in names])
    for j in range(30):
        table[f"f_offset_{j}"] = 100 * np.arange(5) + j  # each offset tells its place
    write_model(tmp_path / "point_cloud.ply", Gaussians(table))
    write_networks(tmp_path / NETWORKS, random_public(k=10, feat_dim=32).networks)
    public = AnchorModel.read(tmp_path)
    assert (public.anchors.k, public.anchors.feat_dim) == (10, 32)
    assert public.anchors.offsets[2, 7].tolist() == [207, 217, 227]
    sizes = {name: sum(array.size for array in network.values()) for name, network in public.networks.items()}
    assert sizes == {"opacity": 1482, "cov": 3462, "color": 2142}


def test_anchors_with_networks_of_another_program_or_model_are_refused(tmp_path):
    random_public().write(tmp_path / "point_cloud.ply")
    write_networks(tmp_path / NETWORKS, random_public(k=5).networks)
    with pytest.raises(InputError, match=r"f_offset_\*: expected 15 properties, found 12 properties"):
        AnchorModel.read(tmp_path)
    write_networks(tmp_path / NETWORKS, {**random_public().networks, "cov": random_public(k=5).networks["cov"]})
    with pytest.raises(InputError, match=f"{NETWORKS}: cov: expected"):
        AnchorModel.read(tmp_path)
    (tmp_path / NETWORKS).rename(tmp_path / "opacity_mlp.pt")
    with pytest.raises(InputError, match=f"expected {NETWORKS}"):
        AnchorModel.read(tmp_path)


class Payload:
    """What creates a file when it is unpickled."""

    def __init__(self, file):
        self.file = file

    def __reduce__(self):
        return open, (str(self.file), "w")


@pytest.mark.parametrize("form", ["zip", "legacy", "cut", "list", "bomb"])
def test_a_hostile_or_corrupt_decoder_is_refused_in_one_line_and_not_executed(tmp_path, form):
    torch = pytest.importorskip("torch")
    path = tmp_path / "chkpnt7_net.pth"
    trace = tmp_path / "executed"
    content = {"zip": {"conv1": Payload(trace)}, "list": [torch.ones(2)]}.get(form, {"conv1.bias": torch.ones(1 << 16)})
    torch.save(content, path)
    if form == "legacy":
        path.write_bytes(pickle.dumps({"conv1": Payload(trace)}, protocol=2))
    elif form == "cut":
        path.write_bytes(path.read_bytes()[:200])
    elif form == "bomb":
        with zipfile.ZipFile(path) as archive:
            members = {name: archive.read(name) for name in archive.namelist()}
        with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
            for name, member in members.items():
                archive.writestr(name, member)
    line = r"_net\.pth: file: expected a state dict of PyTorch, found another file; "
    with pytest.raises(InputError, match=line) as error:
        _ = DecoderFile.read(path).network
    assert "\n" not in str(error.value)
    assert not trace.exists()


def test_a_decoder_of_other_layers_is_refused(tmp_path):
    torch = pytest.importorskip("torch")
    torch.save({"conv1.bias": torch.ones(3)}, tmp_path / "chkpnt7_net.pth")
    with pytest.raises(InputError, match=r"conv1\.bias: expected float32 \[64\], finite, found float32 \[3\]"):
        _ = DecoderFile.read(tmp_path / "chkpnt7_net.pth").network
