"""A planner for programs in other languages: one JSON object a line on standard input, one answer a line on standard output.

    python examples/json_lines.py

Start it once and keep it. Every request has "do"; an "id" comes back in the answer. Answers have "ok": true, or "ok":
false and "error", one sentence. Nothing else is ever written, and no request ends the program but "quit", or the end of
the input; when nobody reads the answers any more, it ends too. Coordinates are pixels of the image, angles radians from
the x axis towards the y axis (y runs down).

    {"id": 1, "do": "plan", "image": "photo.jpg", "pixels_per_cm": 4.7, "basket": [500, 140], "time": 2.0, "required": 0.7}
    {"id": 1, "ok": true, "plan": {"schema": "pscover.plan/1", "grasps": [{"x": ..., "y": ..., "theta": ...}, ...], ...}}

"image" is a photo, a PNG of labels or annotations; or give "labels": [[0, 1, ...], ...], rows of whole numbers. Only
one of the two is needed, everything else has the defaults shown in `PLAN`.

    {"id": 2, "do": "next", "policy": "segment", "image": "frame.png", "depth": "frame.npy", "settings": {"required": 0.8}}
    {"id": 2, "ok": true, "actions": [{"action": "pick", "x": ..., "y": ..., "theta": ...}, {"action": "transport", ...}],
     "planned": true, "skipped": 0}

"next" asks a policy for the next trip: make its motions, take a new photo, ask again. What the policy remembers between
two calls stays here; {"do": "reset"} forgets it. "depth" (metres, .npy of the photo's shape) is for policies that need
it, and "failed": [[x, y], ...] are places to leave alone. No actions: nothing is left to do.

    {"id": 3, "do": "policies"}
    {"id": 3, "ok": true, "policies": ["consolidation", "height", ...]}
    {"do": "quit"}
"""

from __future__ import annotations

import io
import json
import os
import sys
from dataclasses import dataclass, field
from typing import Any, TextIO

import msgspec
import numpy as np

from pscover import PscoverError, registry
from pscover.execution.sight import PhotoEyes, Sight
from pscover.images import read_photo
from pscover.inputs import Look
from pscover.perception.depth import read_depth
from pscover.plan_document import document
from pscover.planning import plan
from pscover.policy import Action, Pick, Place
from pscover.robot import Frame
from pscover.scene import Scene

PLAN: dict[str, Any] = {"pixels_per_cm": 4.7, "basket": None, "time": 10.0, "required": 0.7, "seed": 0, "backend": "highs"}
NEXT: dict[str, Any] = {
    "pixels_per_cm": 4.7,
    "basket": None,
    "depth": None,
    "settings": {},
    "failed": [],
    "radius": 9.4,
    "seed": 0,
}
LONGEST = 2**26
"""Characters of a line."""
LARGEST = 1e15
"""Above all numbers in requests."""


class BadRequest(Exception):
    """A request that cannot be understood; the text says what was expected."""


@dataclass
class Server:
    """Answers requests, one after the other.

    Parameters
    ----------
    states
        What each policy remembers.
    calls
        How often "next" was asked, which makes random policies go on.
    """

    states: dict[str, object] = field(default_factory=dict)
    calls: int = 0

    def answer(self, line: str) -> dict[str, Any] | None:
        """The answer to a line; None after "quit"."""
        identity = None
        try:
            request = _object(line)
            identity = _identity(request.get("id"))
            if request.get("do") == "quit":
                return None
            return {"id": identity, "ok": True, **self._done(request)}
        except (BadRequest, PscoverError) as problem:
            return {"id": identity, "ok": False, "error": " ".join(str(problem).split())}
        except Exception as problem:
            # Whatever it is, the robot's program gets an answer that it can read.
            return {"id": identity, "ok": False, "error": f"{type(problem).__name__}: {' '.join(str(problem).split())}"}

    def _done(self, request: dict[str, Any]) -> dict[str, Any]:
        match request.get("do"):
            case "plan":
                return self._plan(request)
            case "next":
                return self._next(request)
            case "policies":
                return {"policies": list(registry.names("policy"))}
            case "reset":
                self.states.clear()
                return {}
            case other:
                raise BadRequest(f'do: expected "plan", "next", "policies", "reset" or "quit", got {json.dumps(other)}')

    def _plan(self, request: dict[str, Any]) -> dict[str, Any]:
        given = _settings(request, PLAN, ("image", "labels"))
        scale, basket = _number(given, "pixels_per_cm"), _point(given["basket"], "basket")
        if ("image" in request) == ("labels" in request):
            raise BadRequest('expected either "image" or "labels"')
        if "labels" in request:
            seen: Any = Scene.of(_rows(request["labels"]), pixels_per_cm=scale, basket=basket)
        else:
            seen = Look(pixels_per_cm=scale, basket=basket).read(_text(request, "image"))
        found = plan(
            seen,
            time=_number(given, "time"),
            required=_number(given, "required"),
            seed=_whole(given, "seed"),
            backend=_text(given, "backend"),
        )
        return {"plan": msgspec.to_builtins(document(found))}

    def _next(self, request: dict[str, Any]) -> dict[str, Any]:
        given = _settings(request, NEXT, ("policy", "image"))
        if not isinstance(given["settings"], dict) or not isinstance(given["failed"], list):
            raise BadRequest('expected "settings" to be an object and "failed" a list of [x, y]')
        name = _text(request, "policy")
        policy = registry.policy(name, given["settings"])
        depth = None if given["depth"] is None else np.asarray(read_depth(_text(given, "depth")), dtype=np.float32)
        look = Look(pixels_per_cm=_number(given, "pixels_per_cm"), basket=_point(given["basket"], "basket"))
        failed = [_place(point, "failed") for point in given["failed"]]
        frame = Frame(rgb=read_photo(_text(request, "image")), depth=depth)
        sight = Sight(frame, PhotoEyes(look=look), failed, _number(given, "radius"))
        decision = policy.next(sight, self.states.get(name), np.random.default_rng([_whole(given, "seed"), self.calls]))
        self.states[name], self.calls = decision.state, self.calls + 1
        return {
            "actions": [_action(action) for action in decision.actions],
            "planned": decision.plan is not None,
            "skipped": len(decision.skipped),
        }


def _no_number(name: str) -> float:
    raise BadRequest(f"expected JSON, which has no number {name}")


def _object(line: str) -> dict[str, Any]:
    if len(line) > LONGEST:
        raise BadRequest(f"expected a line of at most {LONGEST} characters, got {len(line)}")
    try:
        request = json.loads(line, parse_constant=_no_number)
    except (ValueError, RecursionError) as problem:
        raise BadRequest(f"expected a JSON object on one line, got something else ({problem})") from None
    if not isinstance(request, dict):
        raise BadRequest(f"expected a JSON object, got {type(request).__name__}")
    return request


def _settings(request: dict[str, Any], defaults: dict[str, Any], others: tuple[str, ...]) -> dict[str, Any]:
    known = (*defaults, *others, "id", "do")
    for name in request:
        if name not in known:
            raise BadRequest(f"unknown name {name!r}; known: {', '.join(known)}")
    return {**defaults, **{name: request[name] for name in defaults if name in request}}


def _identity(value: Any) -> str | int | None:
    if isinstance(value, bool) or not isinstance(value, str | int | None):
        raise BadRequest("id: expected text or a whole number")
    return value


def _number(given: dict[str, Any], name: str) -> float:
    value = given[name]
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise BadRequest(f"{name}: expected a number, got {json.dumps(value)}")
    if not abs(value) < LARGEST:
        raise BadRequest(f"{name}: expected a number of ordinary size, got a larger one")
    return float(value)


def _whole(given: dict[str, Any], name: str) -> int:
    value = given[name]
    if isinstance(value, bool) or not isinstance(value, int) or value < 0:
        raise BadRequest(f"{name}: expected a whole number of at least 0, got {json.dumps(value)}")
    return value


def _text(given: dict[str, Any], name: str) -> str:
    value = given.get(name)
    if not isinstance(value, str):
        raise BadRequest(f"{name}: expected text, got {json.dumps(value)}")
    return value


def _point(value: Any, name: str) -> tuple[float, float] | None:
    return None if value is None else _place(value, name)


def _place(value: Any, name: str) -> tuple[float, float]:
    if not isinstance(value, list) or len(value) != 2:
        raise BadRequest(f"{name}: expected [x, y], got {json.dumps(value)}")
    return _number({name: value[0]}, name), _number({name: value[1]}, name)


def _rows(value: Any) -> Any:
    is_grid = isinstance(value, list) and all(isinstance(row, list) for row in value)
    if not is_grid or len({len(row) for row in value}) != 1:
        raise BadRequest("labels: expected rows of whole numbers, all of one length")
    return value


def _action(action: Action) -> dict[str, Any]:
    if isinstance(action, Pick):
        return {"action": "pick", "x": action.pose.x, "y": action.pose.y, "theta": action.pose.theta}
    if isinstance(action, Place):
        return {"action": "place", "x": action.x, "y": action.y}
    return {"action": "transport", "basket": action.basket}


def serve(requests: TextIO, answers: TextIO) -> None:
    """Answer every line until "quit" or the end."""
    server = Server()
    for line in requests:
        if not line.strip():
            continue
        answer = server.answer(line)
        if answer is None:
            return
        answers.write(json.dumps(answer) + "\n")
        answers.flush()


if __name__ == "__main__":
    # Bytes that are no UTF-8 make a bad request, not the end.
    requests = io.TextIOWrapper(sys.stdin.buffer, encoding="utf-8", errors="replace")
    try:
        serve(requests, sys.stdout)
    except BrokenPipeError:
        # Python would complain once more when it flushes at its end.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    except KeyboardInterrupt:
        sys.exit(130)
