"""Plug-ins that the tests and the programs that they start find without installing them: the scheme `planted` of the
tests, and the examples.
"""

import os
import sys
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[1]
EXAMPLES = ROOT / "examples"
PACKAGES = (ROOT / "tests" / "plugins", EXAMPLES / "lsb_opacities", EXAMPLES / "marked_clones")
INFOS = ROOT / ".pytest_cache" / "plugins"
PLUGIN_PATH = [str(folder) for folder in (*PACKAGES, INFOS)]


def register() -> None:
    """Put them on the import path, unless this is a test process of one that has."""
    for package in PACKAGES:
        write_info(tomllib.loads((package / "pyproject.toml").read_text())["project"], INFOS)
    before = [folder for folder in os.environ.get("PYTHONPATH", "").split(os.pathsep) if folder]
    sys.path += [folder for folder in PLUGIN_PATH if folder not in sys.path]
    os.environ["PYTHONPATH"] = os.pathsep.join(dict.fromkeys([*before, *PLUGIN_PATH]))


def write_info(project: Mapping[str, Any], folder: Path) -> None:
    """Write name, version and entry points of a project to a folder of the import path, as pip does."""
    name, version = project["name"].replace("-", "_"), project["version"]
    info = folder / f"{name}-{version}.dist-info"
    info.mkdir(parents=True, exist_ok=True)
    entries = [
        f"[{group}]\n" + "".join(f"{name} = {value}\n" for name, value in names.items())
        for group, names in project["entry-points"].items()
    ]
    metadata = f"Metadata-Version: 2.1\nName: {name}\nVersion: {version}\n"
    for file, text in (("METADATA", metadata), ("entry_points.txt", "".join(entries))):
        if not (info / file).is_file() or (info / file).read_text() != text:  # another test process may be reading it
            (info / file).write_text(text)
