"""The JSON Schemas of the file formats, generated from the structs that read them.

`python -m pscover.io.schema [folder]` writes them, by default to `instances/schema`.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path

import msgspec

from pscover.files import write_bytes
from pscover.io.json import InstanceV1
from pscover.io.result import ResultV1

DOCUMENTS: dict[str, type[msgspec.Struct]] = {"instance-1.json": InstanceV1, "result-1.json": ResultV1}


def schema_text(document: type[msgspec.Struct]) -> str:
    """The JSON Schema of a document as indented text.

    Examples
    --------
    >>> json.loads(schema_text(InstanceV1))["$defs"]["Element"]["required"]
    ['required']
    """
    schema = msgspec.json.schema(document)
    # The tag is what makes a file of this version: msgspec lets it be absent where there is one version.
    body = schema["$defs"][document.__name__]
    body["required"] = ["schema", *(field for field in body["required"] if field != "schema")]
    whole = {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": str(document.__struct_config__.tag),
        **schema,
    }
    return json.dumps(whole, indent=1) + "\n"


def write_schemas(folder: Path) -> list[Path]:
    """Write all schemas to a folder; returns the files."""
    written = []
    for name, document in DOCUMENTS.items():
        write_bytes(folder / name, schema_text(document).encode())
        written.append(folder / name)
    return written


if __name__ == "__main__":
    for path in write_schemas(Path(*sys.argv[1:2]) if sys.argv[1:] else Path("instances", "schema")):
        sys.stdout.write(f"{path}\n")
