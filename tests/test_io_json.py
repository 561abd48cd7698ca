"""The JSON reader: what is wrong, where, what was expected and what was found."""

from __future__ import annotations

import json
from typing import Any

import msgspec
import numpy as np
import pytest

from pscover import Instance, InvalidInstance, Meta
from pscover.io.documents import Versions
from pscover.io.json import Candidate, Element, InstanceV1, Pair, decode, encode

SOUND: dict[str, Any] = {
    "schema": "pscover.instance/1",
    "elements": [{"required": 0.7}, {"required": 0.5}],
    "candidates": [{"covers": [[0, 0.8]]}, {"covers": [[0, 0.5], [1, 1]], "cost": 2.5}],
    "conflicts": [[0, 1]],
}


def changed(path: str, text: str) -> bytes:
    """The sound document with raw text at a path such as candidates.1.cost."""
    document = json.loads(json.dumps(SOUND))
    *parents, last = path.split(".")
    node = document
    for key in parents:
        node = node[int(key)] if key.isdigit() else node[key]
    if last.isdigit():
        node[int(last)] = "@@"
    else:
        node[last] = "@@"
    return json.dumps(document).replace('"@@"', text).encode()


def refusal(content: bytes) -> str:
    with pytest.raises(InvalidInstance) as caught:
        decode(content, "file.json")
    return str(caught.value)


def test_defaults_and_values() -> None:
    instance = decode(json.dumps(SOUND).encode())
    assert instance.probability.toarray().tolist() == [[0.8, 0.5], [0.0, 1.0]]
    assert instance.cost.tolist() == [1.0, 2.5]
    assert instance.required.tolist() == [0.7, 0.5]
    assert [clique.tolist() for clique in instance.conflicts] == [[0, 1]]
    meta = instance.meta
    assert (meta.name, meta.source, meta.elements, meta.candidates) == ("", "", (), ())
    assert meta.poses is None
    assert meta.optimum is None


@pytest.mark.parametrize(
    ("path", "text", "message"),
    [
        ("candidates.1.covers.0.1", "1.5", "$.candidates[1].covers[0][1]: expected float <= 1.0, got 1.5"),
        ("candidates.1.covers.0.1", "0", "$.candidates[1].covers[0][1]: expected float > 0.0, got 0"),
        ("candidates.1.covers.0.1", "-0.5", "$.candidates[1].covers[0][1]: expected float > 0.0, got -0.5"),
        ("candidates.1.covers.0.1", "1e-400", "$.candidates[1].covers[0][1]: expected float > 0.0, got 0.0"),
        (
            "candidates.1.covers.0.1",
            "1e999",
            "$.candidates[1].covers[0][1]: expected a finite number, got one that is too large",
        ),
        ("candidates.1.covers.0.1", '"x"', '$.candidates[1].covers[0][1]: expected float, got "x"'),
        ("candidates.1.covers.0.1", "null", "$.candidates[1].covers[0][1]: expected float, got null"),
        ("candidates.1.covers.0.1", "true", "$.candidates[1].covers[0][1]: expected float, got true"),
        ("candidates.1.covers.0.0", "2", "$.candidates[1].covers[0][0]: expected an element below 2, got 2"),
        ("candidates.1.covers.0.0", "-1", "$.candidates[1].covers[0][0]: expected int >= 0, got -1"),
        ("candidates.1.covers.0.0", "0.0", "$.candidates[1].covers[0][0]: expected int, got 0.0"),
        (
            "candidates.1.covers.0.0",
            "9" * 30,
            "$.candidates[1].covers[0][0]: expected int <= 2147483647, got 999999999999999999999999999999",
        ),
        (
            "candidates.1.covers.0.0",
            "1",
            "$.candidates[1].covers[1][0]: expected each element once in a candidate, got 1 twice",
        ),
        ("candidates.1.covers.0", "[0]", "$.candidates[1].covers[0]: expected array of at least length 2, got [0]"),
        ("candidates.1.covers.0", "[0, 1, 2]", "$.candidates[1].covers[0]: expected [element, p], got [0,1,2]"),
        ("candidates.1.covers.0", "{}", "$.candidates[1].covers[0]: expected array, got {}"),
        ("candidates.1.cost", "0", "$.candidates[1].cost: expected float > 0.0, got 0"),
        ("candidates.1.price", "1", '$.candidates[1]: expected only fields of this schema, got "price"'),
        ("candidates.1", "{}", "$.candidates[1]: expected the field 'covers', got an object without it"),
        ("candidates.1.name", "5", "$.candidates[1].name: expected str, got 5"),
        ("candidates.1.pose", "[1, 2, 3]", "$.candidates[0]: expected a pose, as other candidates have one, got none"),
        ("candidates.1.pose", "[1, 2]", "$.candidates[1].pose: expected array of length 3, got [1,2]"),
        ("elements.1.required", "1", "$.elements[1].required: expected float < 1.0, got 1"),
        ("elements.1.required", "-0.1", "$.elements[1].required: expected float >= 0.0, got -0.1"),
        ("elements", "3", "$.elements: expected array, got 3"),
        ("conflicts.0", "[0]", "$.conflicts[0]: expected array of length >= 2, got [0]"),
        ("conflicts.0", "[0, 2]", "$.conflicts[0][1]: expected a candidate below 2, got 2"),
        ("conflicts.0", "[1, 0, 1]", "$.conflicts[0][2]: expected each candidate once in a conflict, got 1 twice"),
        ("schema", '"pscover.instance/7"', "$.schema: expected 'pscover.instance/1', got \"pscover.instance/7\""),
        ("schema", '""', "$.schema: expected 'pscover.instance/1', got \"\""),
        ("schema", "1", "$.schema: expected 'pscover.instance/1', got 1"),
        ("optimum", '"low"', '$.optimum: expected float | null, got "low"'),
    ],
)
def test_wrong_values_are_told_with_path_expected_and_got(path: str, text: str, message: str) -> None:
    assert refusal(changed(path, text)) == f"file.json: {message}"


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", "expected a JSON document, got an empty file"),
        (b" \n", "expected a JSON document, got an empty file"),
        (b"{", "line 1, column 2: expected the rest of the document, got the end of the file"),
        (b"[]", "$: expected object, got []"),
        (b"null", "$: expected object, got null"),
        (b'{"elements": [], "candidates": []}', "$: expected the field 'schema', got an object without it"),
        (b'{"schema": "pscover.result/1"}', "$.schema: expected 'pscover.instance/1', got \"pscover.result/1\""),
        (
            b'{"schema":\n "pscover.instance/1" "b"}',
            "line 2, column 23: expected a JSON document, got '\"b\"}', which is no JSON here",
        ),
        (b"{\xff}", "line 1, column 2: expected text in UTF-8, got the byte 0xff"),
        (
            b'{"schema": "pscover.instance/1", "name": "\xff"}',
            "line 1, column 43: expected text in UTF-8, got the byte 0xff",
        ),
    ],
)
def test_files_that_are_no_document(content: bytes, message: str) -> None:
    assert refusal(content) == f"file.json: {message}"


@pytest.mark.parametrize("literal", ["NaN", "Infinity", "-Infinity", "nan"])
def test_numbers_that_json_does_not_have(literal: str) -> None:
    message = refusal(changed("candidates.1.covers.0.1", literal))
    assert "line 1, column " in message
    assert f"expected a finite number, got '{literal.removeprefix('-')}" in message


@pytest.mark.parametrize("cut", range(1, 40))
def test_truncated_documents(cut: int) -> None:
    assert refusal(encode(decode(json.dumps(SOUND).encode()))[: -cut - 1]).startswith("file.json: ")


def test_deep_nesting() -> None:
    deep = b"[" * 200_000
    for content in (deep, changed("name", deep.decode()), b'{"x":' * 100_000, b'{"a": ' + deep + b', "schema": 1}'):
        assert refusal(content).startswith("file.json: ")


@pytest.mark.parametrize(
    ("old", "new"),
    [
        (b'"elements"', b'"conflicts": [], "elements"'),
        (b'"elements"', b'"elements": [], "elements"'),
        (b'"cost"', b'"cost": 1, "cost"'),
        (b'"cost"', b'"co\\u0073t": 1, "cost"'),
        (b'"schema"', b'"schema": "pscover.instance/1", "schema"'),
        (b'"required"', b'"required": 0.1, "required"'),
    ],
)
def test_a_key_given_twice_is_an_error(old: bytes, new: bytes) -> None:
    assert "expected each key of an object once" in refusal(json.dumps(SOUND).encode().replace(old, new, 1))


def test_names_with_quotes_and_escapes_are_no_repeated_keys() -> None:
    names = ('say "cost"', '"covers":', "\\", "\n")
    meta = Meta(name='"', source='\\"', elements=names)
    assert decode(encode(Instance.of(np.full((4, 2), 0.5), meta=meta))).meta.elements == names


def test_absent_names_are_replaced_by_numbers_where_others_have_one() -> None:
    content = changed("elements.1.name", '"sock"')
    assert decode(content).meta.elements == ("0", "sock")


def test_one_candidate_a_line() -> None:
    lines = encode(decode(json.dumps(SOUND).encode())).decode().splitlines()
    assert '{"covers":[[0,0.5],[1,1.0]],"cost":2.5}' in lines


class InstanceV0(msgspec.Struct, tag_field="schema", tag="pscover.instance/0"):
    """An old version, in which p was given as a percentage."""

    required: list[float]
    percent: list[list[float]]

    def upgrade(self) -> InstanceV1:
        columns = [[Pair(j, row[i] / 100) for j, row in enumerate(self.percent)] for i in range(len(self.percent[0]))]
        return InstanceV1(elements=[Element(q) for q in self.required], candidates=[Candidate(column) for column in columns])


def test_old_versions_are_upgraded_and_unknown_ones_named() -> None:
    versions = Versions(newest=InstanceV1, old=(InstanceV0,), error=InvalidInstance)
    old = b'{"schema": "pscover.instance/0", "required": [0.7], "percent": [[80, 50]]}'
    assert [c.covers[0].probability for c in versions.decode(old, "old").candidates] == [0.8, 0.5]
    with pytest.raises(InvalidInstance, match=r"one of pscover\.instance/0, pscover\.instance/1, got"):
        versions.decode(b'{"schema": "pscover.instance/2"}', "new")
