"""The folder of an experiment: one file an episode, whole or not there, so that a killed experiment goes on where it was."""

from __future__ import annotations

from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import Any, TypeVar

import msgspec

from pscover.errors import InvalidResult, InvalidSettings, PscoverError
from pscover.experiment.trial import Outcome, Timing, Trial
from pscover.files import read_bytes, write_bytes

BYTE_LIMIT = 2**20
SETTINGS = "experiment.json"
T = TypeVar("T")


@dataclass(frozen=True, slots=True)
class Store:
    """The episodes in a folder.

    Parameters
    ----------
    folder
        Made by `Store.of`.
    """

    folder: Path

    @classmethod
    def of(cls, folder: str | PathLike[str], trial: Trial) -> Store:
        """The folder of an experiment whose trials differ from the given one by policy and seed only.

        Raises
        ------
        InvalidSettings
            If it holds episodes that were run with other settings, or is no experiment's folder and holds anything.
        PscoverError
            If it cannot be written.
        """
        store = cls(Path(folder))
        try:
            store.folder.mkdir(parents=True, exist_ok=True)
        except OSError as problem:
            raise PscoverError(f"{folder}: cannot be made a folder: {problem.strerror}") from None
        path, settings = store.folder / SETTINGS, _settings(trial)
        if not path.exists():
            _check_empty(store.folder)
        elif read_bytes(path, BYTE_LIMIT, InvalidResult) != settings:
            raise InvalidSettings(f"{path}: expected the settings of this run, got others; use another folder for -o")
        write_bytes(path, settings)
        return store

    def save(self, outcome: Outcome, timing: Timing) -> None:
        """Keep an episode; the outcome last, for it marks the episode as done."""
        for kind, content in (("timing", timing), ("episodes", outcome)):
            path = self._path(kind, outcome.policy, outcome.seed)
            path.parent.mkdir(parents=True, exist_ok=True)
            write_bytes(path, msgspec.json.encode(content) + b"\n")

    def outcome(self, policy: str, seed: int) -> Outcome | None:
        """What came of an episode; None if it has not been run to its end.

        Raises
        ------
        InvalidResult
            If the file is damaged.
        """
        return self._read("episodes", policy, seed, Outcome)

    def timing(self, policy: str, seed: int) -> Timing | None:
        """How long it took."""
        return self._read("timing", policy, seed, Timing)

    def _path(self, kind: str, policy: str, seed: int) -> Path:
        return self.folder / kind / policy / f"{seed:04d}.json"

    def _read(self, kind: str, policy: str, seed: int, type_: type[T]) -> T | None:
        path = self._path(kind, policy, seed)
        if not path.exists():
            return None
        try:
            return msgspec.json.decode(read_bytes(path, BYTE_LIMIT, InvalidResult), type=type_)
        except msgspec.DecodeError as problem:
            raise InvalidResult(
                f"{path}: expected an episode, got something else ({problem}); delete it to run it again"
            ) from None


def _check_empty(folder: Path) -> None:
    """Raise `InvalidSettings` if there is anything in a folder that no experiment made."""
    found = min((entry.name for entry in folder.iterdir()), default=None)
    if found is not None:
        raise InvalidSettings(
            f"{folder}: expected the folder of an experiment ({SETTINGS}) or an empty one, got one with {found!r} in it; "
            "use another folder for -o"
        )


def _constants(world: str) -> dict[str, Any] | None:
    """Of the simulated world: episodes under other constants are another experiment."""
    if world != "cloth":
        return None
    from pscover.sim.settings import WorldSettings

    constants: dict[str, Any] = msgspec.to_builtins(WorldSettings())
    return constants


def _settings(trial: Trial) -> bytes:
    """All settings but the policy, the seed, and where things are kept."""
    content: dict[str, Any] = {
        "schema": "pscover.experiment/2",
        "world": trial.world,
        "constants": _constants(trial.world),
        "segmenter": trial.segmenter,
        "options": trial.settings,
        "predictor": trial.predictor,
        "patience": {name: value for name, value in msgspec.to_builtins(trial.patience).items() if value is not None},
    }
    return msgspec.json.format(msgspec.json.encode(content, order="sorted"), indent=2) + b"\n"
