"""Versioned JSON documents: which version a file has, what is wrong with it and where.

Every document names its version in the field `schema`. A version is a msgspec struct tagged with it; an old version has a
method `upgrade()` that returns a document of the next one, so that a reader only ever deals with the newest.
"""

from __future__ import annotations

import json
import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Generic, Protocol, TypeVar, Union, cast, runtime_checkable

import msgspec

from pscover.errors import PscoverError

Newest = TypeVar("Newest", bound=msgspec.Struct)
SHOWN = 60
"""At most this many characters of a wrong value are quoted."""


@runtime_checkable
class Upgradable(Protocol):
    """A document of an old version."""

    def upgrade(self) -> msgspec.Struct:
        """The same content as a document of the next version."""
        ...


class _Unversioned(msgspec.Struct, tag_field="schema", tag=""):
    """No version. It makes the tag required: msgspec lets it be absent where there is only one version to choose."""


@dataclass(frozen=True, slots=True)
class Versions(Generic[Newest]):
    """The versions of a kind of document.

    Parameters
    ----------
    newest
        The struct of the newest version.
    old
        Those of older versions, which have a method `upgrade()`.
    error
        What to raise.
    """

    newest: type[Newest]
    old: tuple[type[msgspec.Struct], ...]
    error: type[PscoverError]

    @property
    def tags(self) -> dict[str, type[msgspec.Struct]]:
        """The struct of each version by its tag."""
        structs: tuple[type[msgspec.Struct], ...] = (*self.old, self.newest)
        return {str(struct.__struct_config__.tag): struct for struct in structs}

    def decode(self, content: bytes, source: str | Path) -> Newest:
        """The document in `content`, upgraded to the newest version.

        Parameters
        ----------
        content
            JSON, not to be trusted.
        source
            What to call it in messages.

        Raises
        ------
        PscoverError
            Of the type `error`: source, place, what was expected, what was found.
        """
        known = self.tags
        try:
            document = msgspec.json.decode(content, type=Union[(*known.values(), _Unversioned)])
        except (msgspec.DecodeError, UnicodeDecodeError) as error:
            told = f"$.schema: expected {_one_of(known)}, got " if str(error).endswith("at `$.schema`") else ""
            raise self.error(
                f"{source}: {told + _value(content, '$.schema') if told else explain(content, error)}"
            ) from None
        except RecursionError:
            raise self.error(f"{source}: expected a document of a few levels, got one nested too deeply") from None
        if isinstance(document, _Unversioned):
            raise self.error(f'{source}: $.schema: expected {_one_of(known)}, got ""')
        while isinstance(document, Upgradable):
            document = document.upgrade()
        return cast(Newest, document)

    def require_unique_keys(self, content: bytes, source: str | Path) -> None:
        """Raise if an object of the document has a key twice, which JSON decoders pass over in silence."""

        def unique(pairs: list[tuple[str, Any]]) -> None:
            keys = [key for key, _ in pairs]
            if len(set(keys)) < len(keys):
                twice = next(key for k, key in enumerate(keys) if key in keys[:k])
                raise self.error(f"{source}: expected each key of an object once, got {quoted(twice)} twice")

        try:
            # Numbers stay text: their values do not matter here, and long ones are slow to convert.
            json.loads(content, object_pairs_hook=unique, parse_int=str, parse_float=str)
        except RecursionError:
            raise self.error(f"{source}: expected a document of a few levels, got one nested too deeply") from None


def explain(content: bytes, error: Exception) -> str:
    """Place, what was expected and what was found, for an error that msgspec raised on `content`.

    Examples
    --------
    >>> try:
    ...     msgspec.json.decode(b'[0.5, "high"]', type=list[float])
    ... except msgspec.DecodeError as error:
    ...     explain(b'[0.5, "high"]', error)
    '$[1]: expected float, got "high"'
    """
    if isinstance(error, UnicodeDecodeError):
        return _not_text(content)
    if not isinstance(error, msgspec.ValidationError):
        return _syntax(content, str(error))
    text, _, path = str(error).replace("`", "").partition(" - at ")
    path = path or "$"
    if found := re.fullmatch(r"Object missing required field (.*)", text):
        return f"{path}: expected the field {found[1]!r}, got an object without it"
    if found := re.fullmatch(r"Object contains unknown field (.*)", text, re.DOTALL):
        return f"{path}: expected only fields of this schema, got {quoted(found[1])}"
    if text.startswith("Number out of range"):
        return f"{path}: expected a finite number, got one that is too large"
    expected = text.split(", got ")[0].replace("Expected", "expected", 1)
    return f"{path}: {expected}, got {_value(content, path)}"


def quoted(value: object) -> str:
    """A wrong value for a message: as JSON where possible, and not too long."""
    try:
        text = msgspec.json.encode(value).decode()
    except (TypeError, ValueError, RecursionError):
        text = repr(value)
    return text if len(text) <= SHOWN else f"{text[:SHOWN]}..."


def _value(content: bytes, path: str) -> str:
    """What stands at a path like $.candidates[1].covers."""
    try:
        value = msgspec.json.decode(content)
        for key, position in re.findall(r"\.(\w+)|\[(\d+)\]", path):
            value = value[key] if key else value[int(position)]
    except (msgspec.DecodeError, UnicodeDecodeError, RecursionError, LookupError, TypeError):
        return "something else"
    return quoted(value)


def _syntax(content: bytes, text: str) -> str:
    if not content.strip():
        return "expected a JSON document, got an empty file"
    if "truncated" in text:
        return f"{_position(content, len(content))}: expected the rest of the document, got the end of the file"
    found = re.search(r"byte (\d+)", text)
    if found is None:
        return f"expected a JSON document, got an error: {text}"
    at = int(found[1])
    try:
        content.decode()
    except UnicodeDecodeError as error:
        if error.start <= at:
            return _not_text(content)
    # msgspec stops before, within or after such a word, as far as it looks like null.
    if word := re.search(rb"(?i)\b(nan|inf(inity)?)\b", content[max(0, at - 4) : at + 12]):
        return f"{_position(content, at)}: expected a finite number, got {word[0].decode()!r}, which JSON does not have"
    got = content[at : at + 20].decode(errors="replace")
    return f"{_position(content, at)}: expected a JSON document, got {got!r}, which is no JSON here"


def _not_text(content: bytes) -> str:
    try:
        content.decode()
    except UnicodeDecodeError as error:
        return f"{_position(content, error.start)}: expected text in UTF-8, got the byte 0x{content[error.start]:02x}"
    return "expected text in UTF-8, got other bytes"


def _position(content: bytes, at: int) -> str:
    before = content[:at]
    line = before.count(b"\n") + 1
    column = len(before[before.rfind(b"\n") + 1 :].decode(errors="replace")) + 1
    return f"line {line}, column {column}"


def _one_of(tags: dict[str, type[msgspec.Struct]]) -> str:
    names = sorted(tags)
    return repr(names[0]) if len(names) == 1 else f"one of {', '.join(names)}"
