"""Which edits of the package's code a stage notices."""

import pytest

from gspure.workflow import sources
from gspure.workflow.sources import code_digest

MODULES = {
    "__init__": "from gspure.unrelated import number\n",
    "stage": "def run():\n    from gspure.middle import deep\n",
    "middle/__init__": "from gspure.middle.deep import depth\nimport gspure.stage\n",
    "middle/deep": "import numpy\ndepth = 1\n",
    "unrelated": "number = 1\n",
}
PLUGIN = {
    "__init__": "",
    "attack": "import numpy\nfrom gspure.unrelated import number\nfrom . import order\n",
    "order": "from .shares import share\n",
    "shares": "share = 1\n",
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


@pytest.mark.parametrize("module", ["attack", "order", "shares"])
def test_an_edit_of_a_plug_in_changes_the_digest(package, module):
    before = code_digest("gspure.stage", "murky.attack")
    assert before != code_digest("gspure.stage")
    (package / "installed" / "murky" / f"{module}.py").write_text(PLUGIN[module] + "# edited\n")
    assert code_digest("gspure.stage", "murky.attack") != before
