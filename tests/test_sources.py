"""Which edits of the package's code a stage notices."""

import os

import pytest

from gspure.errors import InputError
from gspure.workflow import sources
from gspure.workflow.sources import code_digest, files_digest, note_inputs, require_inputs, write_inputs

MODULES = {
    "__init__": "from gspure.unrelated import number\n",
    "stage": "def run():\n    from gspure.middle import deep\n",
    "middle/__init__": "from gspure.middle.deep import depth\nimport gspure.stage\n",
    "middle/deep": "import numpy\ndepth = 1\n",
    "unrelated": "number = 1\n",
    "opencl/__init__": "",
    "drawing": "import gspure.opencl\n",
}
PLUGIN = {
    "__init__": "",
    "attack": '"""\nfrom ... import order\n"""\nimport numpy; import gspure.unrelated\nfrom . import \\\n order\n',
    "order": "from .shares import share\n",
    "shares": "share = 1\nfrom murky.deep import depth\n",
    "deep/__init__": "from .depth import depth\n",
    "deep/depth": "from .floor import floor\nfrom ..order import share\ndepth = 1\n",
    "deep/floor": "floor = 1\n",
}


def forget():
    sources._imports.cache_clear()
    sources._file.cache_clear()


@pytest.fixture
def package(tmp_path, monkeypatch):
    """Return a folder with the package, and with a plug-in."""
    monkeypatch.setattr(sources, "_PACKAGE", tmp_path)
    monkeypatch.syspath_prepend(str(tmp_path / "installed"))
    plugin = {f"installed/murky/{name}": text for name, text in PLUGIN.items()}
    for name, text in (MODULES | plugin).items():
        (tmp_path / f"{name}.py").parent.mkdir(exist_ok=True, parents=True)
        (tmp_path / f"{name}.py").write_text(text)
    forget()
    yield tmp_path
    forget()


@pytest.mark.parametrize("module", ["stage", "middle/__init__", "middle/deep"])
def test_an_edit_anywhere_below_a_stage_changes_its_digest(package, module):
    before = code_digest("gspure.stage")
    (package / f"{module}.py").write_text(MODULES[module] + "# edited\n")
    assert code_digest("gspure.stage") != before


@pytest.mark.parametrize("module", ["attack", "order", "shares", "deep/__init__", "deep/depth", "deep/floor"])
def test_an_edit_of_a_plug_in_changes_the_digest(package, module):
    before = code_digest("gspure.stage", "murky.attack")
    assert before != code_digest("gspure.stage")
    (package / "installed" / "murky" / f"{module}.py").write_text(PLUGIN[module] + "# edited\n")
    assert code_digest("gspure.stage", "murky.attack") != before


def test_a_plug_in_counts_with_what_it_imports_from_another_one():
    assert "gspure_torch.bridge" in sources._imports("marked_clones.marking")


def test_an_edit_of_the_packages_own_names_or_of_what_is_not_imported_changes_nothing(package):
    before = code_digest("gspure.stage")
    for module in ("__init__", "unrelated"):
        (package / f"{module}.py").write_text(MODULES[module] + "# edited\n")
    forget()
    assert code_digest("gspure.stage") == before


def test_a_script_counts_with_what_it_imports(package):
    script = package / "script.py"
    script.write_text("import gspure.middle.deep\n")
    before = code_digest(script)
    (package / "middle" / "deep.py").write_text("depth = 2\n")
    edited = code_digest(script)
    script.write_text("import gspure.middle.deep  # edited\n")
    assert len({before, edited, code_digest(script)}) == 3


def test_kernels_count_where_the_device_is_used(package, monkeypatch):
    drawing = code_digest("gspure.drawing")
    stage = code_digest("gspure.stage")
    monkeypatch.setattr(sources, "kernel_digest", lambda: "edited")
    assert code_digest("gspure.drawing") != drawing
    assert code_digest("gspure.stage") == stage


def test_files_count_by_name_and_content(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    file = tmp_path / "a.ply"
    digests = []
    for text, time in (("one", 1), ("two", 1), ("two", 2), ("three", 2)):
        (tmp_path / "new").write_text(text)
        os.utime(tmp_path / "new", (time, time))
        (tmp_path / "new").replace(file)
        digests.append(files_digest([file]))
    first, same_size_and_time, later, longer = digests
    assert same_size_and_time == later
    assert len({first, later, longer, files_digest([file, file])}) == 4
    assert files_digest([]) == files_digest([tmp_path])


def test_a_file_is_read_once_unless_it_changed_just_now(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    reads = []
    monkeypatch.setattr(sources, "file_digest", lambda file: reads.append(file.name) or file.read_text())
    file = tmp_path / "a.ply"
    file.write_text("one")
    for settled in (10**12, 0):  # a change of the next moment might leave size and time as they are
        monkeypatch.setattr(sources, "_SETTLED", settled)
        for _ in range(2):
            sources._known_digests.cache_clear()
            files_digest([file])
    assert len(reads) == 3


def test_steps_refuse_a_file_that_changed_after_the_run_noted_it(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sources, "_noted", {})
    file = tmp_path / "a.ply"
    file.write_text("one")
    note_inputs([file])
    write_inputs()
    noted = files_digest([file])
    file.write_text("one")
    require_inputs()
    file.write_text("two")
    assert files_digest([file]) == noted
    with pytest.raises(InputError, match=r"a\.ply"):
        require_inputs()
