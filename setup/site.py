"""The hooks of mkdocs: pages from outside docs/, generated references, links and formulas."""

from __future__ import annotations

import csv
import html
import json
import os
import posixpath
import re
import sys
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[1]
REPORT = ROOT / "results" / "report.html"
OUTSIDE = {
    "README.md": "index.md",
    "CHANGELOG.md": "changelog.md",
    ".github/CONTRIBUTING.md": "contributing.md",
    "benchmarks/README.md": "benchmarks.md",
    "config/README.md": "configuration.md",
    "examples/adapters/README.md": "adapters.md",
    "experiments/README.md": "experiments.md",
}
"""Pages of the repository, and their places on the site."""

TABLES = ("experiments/tables/", "experiments/results/")
"""Folders outside docs/ whose files pages link to; their places on the site are the same."""

SEE_ALSO = {
    "attacks.md": "\n[Every attack in detail](reference/attacks.md).\n",
    "configuration.md": "\n[Every setting](reference/settings.md).\n",
    "numerics.md": "\n[All constants](reference/constants.md).\n",
}
"""The ends of pages: links to generated ones."""

HISTORY = "Ratios of CPU time, this commit / 44f0201b, measured in turns (`python -m benchmarks.history`)."
SLOWER = 1.1  # a ratio that grew by more is shown in red
FACTS = 3  # columns of the history before the ratios

CLASSES = (
    "gspure.cameras.Camera",
    "gspure.method.purify.Purification",
    "gspure.attacks.Attack",
    "gspure.attacks.Attacked",
    "gspure.public_model.PublicModel",
    "gspure.schemes.scheme.Scheme",
    "gspure.schemes.scheme.Key",
    "gspure.evaluation.results.Result",
)
"""The arguments and results of the functions of the public interface, and the rows of ``results.csv``."""


def python_page() -> str:
    """Return the reference of the public interface."""
    import gspure

    interface = [f"gspure.{name}" for name in gspure.__all__ if name != "__version__"]
    parts = {"The public interface": interface, "Models, cameras, results": CLASSES}
    page = "# Python\n"
    for title, names in parts.items():
        page += f"\n## {title}\n\n" + "".join(f"::: {name}\n" for name in names)
    return page


def commands_page() -> str:
    """Return the help of every command."""
    os.environ["COLUMNS"] = "100"
    from gspure.cli import COMMANDS, parser_of

    sections = (f"## gspure {name}\n\n```text\n{parser_of(name).format_help()}```\n" for name in COMMANDS)
    return "# Commands\n\n" + "\n".join(sections)


def settings_page() -> str:
    """Return a table of every setting of the workflow."""
    from gspure.workflow.schema import config_schema

    schema = config_schema()
    lines = ["# Settings", "", schema["description"], ""]
    for name, settings in schema["properties"].items():
        lines += [f"## {name}", "", settings["description"], ""]
        rows = list(_settings(settings, ""))
        if rows:
            lines += ["| setting | default | meaning |", "| --- | --- | --- |", *rows, ""]
    return "\n".join(lines)


def _settings(schema: dict[str, Any], prefix: str) -> Iterator[str]:
    for name, setting in schema.get("properties", {}).items():
        has_default = "default" in setting and not isinstance(setting["default"], dict)
        default = f"`{json.dumps(setting['default'])}`" if has_default else ""
        meaning = " ".join(setting.get("description", "").split()).replace("|", "\\|")
        yield f"| `{prefix}{name}` | {default} | {meaning} |"
        yield from _settings(setting, f"{prefix}{name}.")
    if isinstance(schema.get("additionalProperties"), dict):
        yield from _settings(schema["additionalProperties"], f"{prefix}NAME.")


def attacks_page() -> str:
    """Return what every built-in attack does, with its settings, strength and source."""
    from gspure.attacks import BUILT_IN
    from gspure.attacks.reference import NOTES, reference

    sections = (f"## {attack.name}\n\n{reference(attack)}" for attack in BUILT_IN)
    return "\n".join(["# Attacks in detail", "", NOTES, *sections])


def constants_page() -> str:
    """Return the constants of the renderer and the method, with their sources."""
    source = (ROOT / "gspure" / "constants.py").read_text(encoding="utf-8")
    return f"# Constants\n\n```python\n{source}```\n"


def history() -> str:
    """Return the last rows of the history of speed; ratios more than a tenth above those before are red."""
    with (ROOT / "benchmarks" / "history.csv").open(newline="", encoding="utf-8") as file:
        header, *rows = csv.reader(file)
    lines = [f"| {' | '.join(header)} |", f"|{' --- |' * len(header)}"]
    for before, row in list(pairwise([rows[0], *rows]))[-10:]:
        ratios = [
            f'<span class="slower">{ratio}</span>' if float(ratio) > SLOWER * float(last) else ratio
            for last, ratio in zip(before[FACTS:], row[FACTS:], strict=True)
        ]
        lines.append(f"| {' | '.join([*row[:FACTS], *ratios])} |")
    return "\n".join(["", "## History", "", HISTORY, "", *lines, ""])


def leaderboard_page() -> str:
    """Return the leaderboard of the committed results."""
    sys.path.insert(0, str(ROOT))
    from experiments.leaderboard_page import page

    return page()


REFERENCE = {
    "leaderboard.md": leaderboard_page,
    "reference/python.md": python_page,
    "reference/attacks.md": attacks_page,
    "reference/commands.md": commands_page,
    "reference/constants.md": constants_page,
    "reference/settings.md": settings_page,
}


def on_files(files: Any, config: Any) -> Any:
    """Add the pages from outside docs/, the references and, if there is one, the report of the demo."""
    from mkdocs.structure.files import File

    for source, place in OUTSIDE.items():
        files.append(File.generated(config, place, content=(ROOT / source).read_text(encoding="utf-8")))
    for place, page in REFERENCE.items():
        files.append(File.generated(config, place, content=page()))
    for table in (file for folder in TABLES for file in (ROOT / folder).rglob("*.csv")):
        place = table.relative_to(ROOT).as_posix()
        files.append(File.generated(config, place, abs_src_path=str(table)))
    if REPORT.is_file():
        files.append(File.generated(config, "report.html", abs_src_path=str(REPORT)))
    return files


def on_page_markdown(markdown: str, page: Any, **_: Any) -> str:
    """Let links lead to pages of the site; links to other files of the repository become text."""
    place = page.file.src_uri
    sources = {page_place: path for path, page_place in OUTSIDE.items()}
    source = sources.get(place, f"docs/{place}")
    if place == "results.md" and REPORT.is_file():
        markdown += "\n[The report of the demo](report.html), with its model in 3-D.\n"
    parts = re.split(r"(^```.*?^```$)", markdown, flags=re.MULTILINE | re.DOTALL)
    parts[::2] = (relinked(part, source, place) for part in parts[::2])
    end = history() if place == "benchmarks.md" else SEE_ALSO.get(place, "")
    return "".join([*parts, end])


def relinked(text: str, source: str, place: str) -> str:
    """Return Markdown of a file `source` whose links fit a page at `place`."""

    def link(match: re.Match[str]) -> str:
        mark, label, target = match.groups()
        path, hash_, anchor = target.partition("#")
        if not path or "://" in path:
            return match[0]
        path = posixpath.normpath(posixpath.join(posixpath.dirname(source), path))
        if path not in OUTSIDE and not path.startswith(("docs/", *TABLES)):
            return label if not mark else ""
        target_place = OUTSIDE.get(path, path.removeprefix("docs/"))
        relative = posixpath.relpath(target_place, posixpath.dirname(place) or ".")
        return f"{mark}[{label}]({relative}{hash_}{anchor})"

    return re.sub(r"(!?)\[((?:[^\[\]]|\[[^\]]*\])*)\]\(([^()\s]+)\)", link, text)


def on_page_content(content: str, **_: Any) -> str:
    """Turn formulas into MathML, which browsers show without scripts."""
    from latex2mathml.converter import convert

    def formula(match: re.Match[str]) -> str:
        display = "block" if match[1] == "div" else "inline"
        return convert(html.unescape(match[2]), display=display)

    return re.sub(r'<(div|span) class="arithmatex">\\[(\[](.*?)\\[)\]]</\1>', formula, content, flags=re.DOTALL)
