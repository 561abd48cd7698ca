"""The JSON Schemas that are shipped are those of the structs that read the files."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from pscover.io.schema import DOCUMENTS, schema_text, write_schemas

INSTANCES = Path(__file__).parent.parent / "instances"


@pytest.mark.parametrize("name", DOCUMENTS)
def test_shipped_schemas_are_not_stale(name: str) -> None:
    shipped = (INSTANCES / "schema" / name).read_text()
    assert shipped == schema_text(DOCUMENTS[name]), "run: python -m pscover.io.schema"


def test_the_command_writes_every_schema(tmp_path: Path) -> None:
    assert sorted(path.name for path in write_schemas(tmp_path)) == sorted(DOCUMENTS)
    assert {json.loads(path.read_text())["title"] for path in tmp_path.iterdir()} == {
        "pscover.instance/1",
        "pscover.result/1",
    }


def test_shipped_instances_fit_the_schema() -> None:
    jsonschema = pytest.importorskip("jsonschema")
    schema = json.loads((INSTANCES / "schema" / "instance-1.json").read_text())
    for path in (INSTANCES / "tiny").glob("*.json"):
        jsonschema.validate(json.loads(path.read_text()), schema)
    with pytest.raises(jsonschema.ValidationError):
        jsonschema.validate({"elements": [], "candidates": []}, schema)
