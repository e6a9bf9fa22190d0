"""Scaffold-GS's files: official layouts are read, ours are read by PyTorch, and nothing in them is executed."""

import zipfile

import numpy as np
import pytest

from gspure.errors import InputError
from gspure.model import Gaussians, write_model
from gspure.schemes.secure_gs.model import AnchorModel
from gspure.schemes.secure_gs.networks import UNITED
from gspure.schemes.tensors import write_tensors
from tests.anchor_cases import random_public


def official_table(count=5):
    """Rows as Scaffold-GS stores them; each offset tells its place."""
    counted = {"f_offset": 30, "f_anchor_feat": 32, "scale": 6, "rot": 4}
    names = [*("x", "y", "z", "opacity"), *(f"{name}_{i}" for name in counted for i in range(counted[name]))]
    table = np.ones(count, [(name, "<f4") for name in names])
    for j in range(30):
        table[f"f_offset_{j}"] = 100 * np.arange(count) + j
    return Gaussians(table)


def write_asset(folder, **settings):
    public = random_public(**settings)
    public.write(folder / "point_cloud.ply")
    return public


def rewritten(path, change):
    """Write an archive again with `change` made to its members."""
    with zipfile.ZipFile(path) as archive:
        members = {name: archive.read(name) for name in archive.namelist()}
    with zipfile.ZipFile(path, "w") as archive:
        for name, content in change(members).items():
            archive.writestr(name, content)


def assert_same_networks(found, expected):
    assert found.keys() == expected.keys()
    for name, network in expected.items():
        assert found[name].keys() == network.keys()
        for parameter, array in network.items():
            np.testing.assert_array_equal(found[name][parameter], array)


def modules(networks):
    """The networks as PyTorch modules, which Scaffold-GS has."""
    torch = pytest.importorskip("torch")
    last = {"opacity": torch.nn.Tanh(), "cov": torch.nn.Identity(), "color": torch.nn.Sigmoid()}
    made = {}
    for name, network in networks.items():
        (hidden, inputs), (outputs, _) = network["0.weight"].shape, network["2.weight"].shape
        linear = torch.nn.Linear(inputs, hidden), torch.nn.Linear(hidden, outputs)
        module = torch.nn.Sequential(linear[0], torch.nn.ReLU(), linear[1], last.get(name, torch.nn.Softmax(1)))
        module.load_state_dict({parameter: torch.from_numpy(array) for parameter, array in network.items()})
        made[name] = module
    return made


def test_the_official_table_loads_with_offsets_by_coordinate(tmp_path):
    write_model(tmp_path / "point_cloud.ply", official_table())
    write_tensors(tmp_path / UNITED, {f"{n}_mlp": net for n, net in random_public(k=10, feat_dim=32).networks.items()})
    public = AnchorModel.read(tmp_path)
    assert (public.anchors.k, public.anchors.feat_dim) == (10, 32)
    assert public.anchors.offsets[2, 7].tolist() == [207, 217, 227]
    assert sum(array.size for array in public.networks["opacity"].values()) == 1482
    assert sum(array.size for array in public.networks["cov"].values()) == 3462
    assert sum(array.size for array in public.networks["color"].values()) == 2142


@pytest.mark.parametrize("bank", [False, True])
@pytest.mark.filterwarnings("ignore::DeprecationWarning")
def test_networks_of_scaffold_gs_are_read(tmp_path, bank):
    torch = pytest.importorskip("torch")
    public = write_asset(tmp_path, bank=bank)
    (tmp_path / UNITED).unlink()
    made = modules(public.networks)
    for name, module in made.items():
        inputs = public.networks[name]["0.weight"].shape[1]
        torch.jit.trace(module, torch.rand(1, inputs)).save(tmp_path / f"{name}_mlp.pt")
    assert_same_networks(AnchorModel.read(tmp_path).networks, public.networks)
    torch.save({f"{name}_mlp": module.state_dict() for name, module in made.items()}, tmp_path / UNITED)
    assert_same_networks(AnchorModel.read(tmp_path).networks, public.networks)


class Payload:
    """What runs a command when it is unpickled."""

    def __init__(self, file):
        self.file = file

    def __reduce__(self):
        return open, (str(self.file), "w")


@pytest.mark.parametrize("form", ["zip", "module", "legacy"])
def test_a_hostile_file_is_refused_and_nothing_is_executed(tmp_path, form):
    import pickle

    write_asset(tmp_path)
    path, trace = tmp_path / UNITED, tmp_path / "executed"
    payload = pickle.dumps({"opacity_mlp": Payload(trace)}, protocol=2)
    if form == "zip":
        rewritten(path, lambda members: members | {"checkpoints/data.pkl": payload})
    elif form == "module":  # the class of a scripted module, and a call that is none of ours
        name = str(trace).encode()
        call = b"\x80\x02cbuiltins\nopen\nX" + len(name).to_bytes(4, "little") + name + b"X\x01\0\0\0w\x86\x81."
        rewritten(path, lambda members: members | {"checkpoints/data.pkl": call})
    else:
        torch = pytest.importorskip("torch")
        torch.save({"opacity_mlp": Payload(trace)}, path, _use_new_zipfile_serialization=False)
    with pytest.raises(InputError, match=r"checkpoints\.pth: .*(nothing in it was executed|zip)"):
        AnchorModel.read(tmp_path)
    assert not trace.exists()


@pytest.mark.parametrize(
    "change",
    [
        lambda members: members | {"checkpoints/data.pkl": b"\xff\xff"},
        lambda members: {name: content for name, content in members.items() if name != "checkpoints/data/0"},
        lambda members: members | {"checkpoints/data/0": b"\0" * 8},
    ],
)
def test_a_corrupt_archive_is_reported_in_one_line(tmp_path, change):
    write_asset(tmp_path)
    rewritten(tmp_path / UNITED, change)
    with pytest.raises(InputError) as error:
        AnchorModel.read(tmp_path)
    assert "\n" not in str(error.value)


def test_a_model_without_its_networks_says_which_are_missing(tmp_path):
    write_asset(tmp_path)
    (tmp_path / UNITED).unlink()
    with pytest.raises(InputError, match=r"opacity_mlp\.pt: no such file"):
        AnchorModel.read(tmp_path)
