"""The JSON schema of the configuration, for editors.

``python -m gspure.workflow.schema > config/config.schema.json`` renews its file.
"""

import json

from gspure import codec
from gspure.files import Json
from gspure.workflow.config import Config
from gspure.workflow.matrix import MATRIX, SECTIONS, Axes


def config_schema() -> Json:
    """Return the JSON schema of a configuration."""
    head = {"$schema": "https://json-schema.org/draft/2020-12/schema", "title": "gspure", "description": Config.__doc__}
    content = head | codec.schema(Config)
    for section in SECTIONS:
        content["properties"][section]["additionalProperties"]["properties"][MATRIX] = codec.schema(Axes)
    return content


def schema_text() -> str:
    """Return the schema as its file holds it."""
    return json.dumps(config_schema(), indent=2) + "\n"


if __name__ == "__main__":
    print(schema_text(), end="")  # noqa: T201
