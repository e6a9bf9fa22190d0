"""The parser of commands: their kinds of arguments, the files that they name, and refusals in one line."""

import argparse
import re
from collections.abc import Callable, Iterable, Iterator
from functools import partial
from pathlib import Path, PosixPath
from typing import Any, NoReturn

from gspure.errors import InputError, did_you_mean, printable
from gspure.settings import Range

Arguments = argparse.Namespace
_DEFAULT = " (default: %(default)s)"


class Output(PosixPath):
    """The type of arguments that name a file to write, never an input."""


class OutputFolder(Output):
    """The type of arguments that name a folder to write to."""


class Unrelated(PosixPath):
    """The type of arguments that name a file or folder to read, of any origin."""


class Parser(argparse.ArgumentParser):
    """A parser that refuses a wrong command line in one line, and empty texts: an empty path is the current folder."""

    def __init__(self, **settings: Any) -> None:
        super().__init__(**settings)
        self._words: list[str] = []
        for kind in (None, Path, Output, OutputFolder, Unrelated):
            self.register("type", kind, partial(filled, kind or str))

    def reads(self, name: str, metavar: str, meaning: str, **settings: Any) -> None:
        """Add a file or folder to read; an option without a default is required unless `required` is false."""
        self._add_path(name, meaning, **{"type": Path, "metavar": metavar, **settings})

    def writes(self, name: str, metavar: str, meaning: str, **settings: Any) -> None:
        """Add a folder (DIR) or file to write; an option without a default is required unless `required` is false.

        The metavar of a file is its format, such as CSV, or PNG|SVG: its name must end with .csv, .png or .svg.
        """
        kind = OutputFolder if metavar == "DIR" else Output
        self._add_path(name, meaning, type=kind, action=_Written, metavar=metavar, **settings)

    def _add_path(self, name: str, meaning: str, **settings: Any) -> None:
        if name.startswith("-") and "default" not in settings:
            settings = {"required": True, **settings}
        self.add_argument(name, help=meaning + _DEFAULT * bool(settings.get("default")), **settings)

    def text(self, name: str, metavar: str, meaning: str, default: str | None = None, **settings: Any) -> None:
        """Add a text."""
        self.add_argument(name, metavar=metavar, help=meaning + _DEFAULT * bool(default), default=default, **settings)

    def number(
        self,
        name: str | tuple[str, ...],
        metavar: str | tuple[str, ...],
        meaning: str,
        limits: Range,
        default: float | None = None,
        *,
        group: argparse._ArgumentGroup | None = None,
        **settings: Any,
    ) -> None:
        """Add a number within `limits`, perhaps to a group of options."""
        known = "" if default is None else _DEFAULT
        settings |= {"metavar": metavar, "help": f"{meaning}; {limits}{known}", "default": default}
        names = (name,) if isinstance(name, str) else name
        (group or self).add_argument(*names, type=Bounded(limits), **settings)

    def choice(self, name: str, choices: Iterable[str], meaning: str, default: str | None = None) -> None:
        """Add one of some texts."""
        known = _DEFAULT * bool(default)
        self.add_argument(name, choices=tuple(choices), help=meaning + known, default=default)

    def flag(self, *names_and_meaning: str) -> None:
        """Add a switch: its names, and its meaning."""
        *names, meaning = names_and_meaning
        self.add_argument(*names, action="store_true", help=meaning)

    def pairs(self, name: str, metavar: str, meaning: str, parse: Callable[[str], Any] = str, **settings: Any) -> None:
        """Add an option ``NAME=VALUE`` for a mapping of names to values; `parse` converts a value or raises."""
        meaning += "; repeatable"
        self.add_argument(name, action=_Assignments, parse=parse, metavar=metavar, help=meaning, **settings)

    def parse_known_args(self, args: Any = None, namespace: Any = None) -> Any:
        """Parse all words: those that a parser of figures does not know would be reported by the one around it."""
        words = [*args]
        end = words.index("--") if "--" in words and "passed_on" in self._defaults else len(words)
        self._words = words[:end]
        parsed, unknown = super().parse_known_args(self._words, namespace)
        if end < len(words):
            parsed.passed_on = words[end + 1 :]
        if unknown:
            self.error(f"unrecognized arguments: {' '.join(unknown)}")
        return parsed, unknown

    def error(self, message: str) -> NoReturn:
        """Print the reason, and exit with status 2; a misspelt option is the reason why others are missing."""
        known = self._option_string_actions
        options = (word.partition("=")[0] for word in self._words if word.startswith("--"))
        unknown = [option for option in options if not any(name.startswith(option) for name in known)]
        if unknown and re.search("required|unrecognized", message):
            message = f"no option {unknown[0]}{suggestion(unknown[0], known)}"
        self.exit(2, f"{self.prog}: {printable(message)}; see `{self.prog} --help`\n")


class Bounded:
    """The type of arguments that are numbers within `limits`."""

    def __init__(self, limits: Range) -> None:
        self.limits = limits

    def __call__(self, text: str) -> float:
        """Return the number that a text spells, or refuse the text."""
        if (value := self.limits.parse(text)) is None:
            raise argparse.ArgumentTypeError(f"expected {self.limits.expected}, found {text!r}")
        return value


class _Assignments(argparse.Action):
    """Collects options ``NAME=VALUE`` in a mapping; a name twice is refused, as one of its values would not count."""

    def __init__(self, parse: Callable[[str], Any] = str, **settings: Any) -> None:
        super().__init__(default={}, **settings)
        self._parse = parse

    def __call__(self, _parser: Any, namespace: Arguments, text: Any, _option: str | None = None) -> None:
        """Add the value of one option."""
        name, _, value = text.partition("=")
        known = getattr(namespace, self.dest)
        if name in known:
            raise argparse.ArgumentError(self, f"expected every name once, found {name} again")
        try:
            parsed = self._parse(value) if name and value else None
        except ValueError:
            parsed = None
        if parsed is None:
            raise argparse.ArgumentError(self, f"expected {self.metavar}, found {text!r}")
        setattr(namespace, self.dest, {**known, name: parsed})


class _Written(argparse.Action):
    """Stores a file or folder to write; the name of a file ends as its content requires."""

    def __call__(self, _parser: Any, namespace: Arguments, path: Any, _option: str | None = None) -> None:
        """Store the path, or refuse a file with another suffix than its metavar names."""
        formats = str(self.metavar)
        suffixes = [f".{name.lower()}" for name in formats.split("|")]
        if formats != "DIR" and not path.name.lower().endswith((*suffixes,)):
            expected = f"a name that ends with {' or '.join(suffixes)}"
            raise argparse.ArgumentError(self, f"expected {expected}, found {path.name!r}")
        setattr(namespace, self.dest, path)


def filled(kind: Callable[[str], Any], text: str) -> Any:
    """Return a text as another type, or refuse an empty one."""
    if not text.strip():
        raise argparse.ArgumentTypeError("expected a value, found an empty text")
    return kind(text)


def suggestion(word: str, known: Iterable[str]) -> str:
    """Return the end of a refusal of `word`: the most similar known one, if any is similar."""
    hint = did_you_mean(word, known)
    return f", {hint}" if hint else ""


def outputs(args: Arguments) -> list[Output]:
    """Return the files and folders to write that a command line names."""
    return [path for path in paths_of(vars(args).values()) if isinstance(path, Output)]


def require_distinct(args: Arguments) -> None:
    """Refuse outputs that would, with their records, overwrite an input, a file in an input folder, or each other.

    A file in an input folder may be replaced if it is a result (`gspure.artifacts.replacement`).
    """
    from gspure.artifacts import require_replaceable
    from gspure.artifacts.checksums import record_file
    from gspure.artifacts.replacement import is_result

    inputs = {_resolved(path) for path in paths_of(vars(args).values()) if not isinstance(path, Output)}
    taken = set(inputs)
    for path in outputs(args):
        file = _resolved(path)
        is_read = file.is_file() and not inputs.isdisjoint(file.parents) and not is_result(path)
        places = {file} if isinstance(path, OutputFolder) else {file, record_file(file)}
        if is_read or places & taken:
            raise InputError(path, "output", expected="a separate file", found="an input or another output")
        if not isinstance(path, OutputFolder):
            require_replaceable(path, record_file(path))
        taken |= places


def _resolved(path: Path) -> Path:
    try:
        return path.resolve()
    except RuntimeError:
        raise InputError(path, "path", expected="a file or folder", found="a symbolic link to itself") from None


def paths_of(values: Iterable[object]) -> Iterator[Path]:
    """Yield the paths among some values, and among those in lists and mappings."""
    for value in values:
        if isinstance(value, Path):
            yield value
        elif isinstance(value, list | tuple):
            yield from paths_of(value)
        elif isinstance(value, dict):
            yield from paths_of(value.values())
