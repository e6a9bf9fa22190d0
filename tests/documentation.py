"""Reading Markdown: its code blocks, and the example of a package."""

import re
import tomllib
from pathlib import Path

from tests.plugin_path import write_info

ROOT = Path(__file__).parents[1]
NAMED = (".github/CONTRIBUTING.md", "config/README.md", "examples/adapters/README.md", "experiments/README.md")
PAGES = [*ROOT.glob("*.md"), *ROOT.glob("docs/*.md"), *(ROOT / name for name in NAMED)]


def blocks(page: Path, language: str) -> list[str]:
    """Return the fenced code blocks of a language."""
    return re.findall(rf"^```{language}\n(.*?)^```$", page.read_text(encoding="utf-8"), re.MULTILINE | re.DOTALL)


def example(name: str) -> str:
    """Return the source of an example of the guide."""
    return next(block for block in blocks(ROOT / "docs" / "extending.md", "python") if f"# {name}.py" in block)


def install_example(folder: Path) -> None:
    """Put the package of the guide into a folder, as pip would."""
    module, metadata = (blocks(ROOT / "docs" / "extending.md", language)[0] for language in ("python", "toml"))
    project = tomllib.loads(metadata)["project"]
    (folder / f"{project['name']}.py").write_text(module)
    write_info(project, folder)
