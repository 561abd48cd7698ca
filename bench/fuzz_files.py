"""Damage files of every format in many ways, and read them under a limit of memory and of time.

    python bench/fuzz_files.py [--mutations 10000] [--seed 0]

Every mutation must be loaded or refused with a `PscoverError`; anything else (another exception, no memory, a hang, a dead
process, a file written) is printed with its number, which makes it again, and makes the exit status 1.
"""

from __future__ import annotations

import argparse
import io
import json
import random
import re
import resource
import selectors
import subprocess
import sys
import tempfile
import time
import zipfile
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from pscover import Instance, PscoverError, solve
from pscover.io import load_instance, load_result, save_instance, save_result

MEMORY = 2 * 2**30
"""Bytes of address space of the process that reads: NumPy, SciPy and HiGHS alone take some 0.7 GiB of it."""

SECONDS = 10.0
"""For one file."""

TINY = Path(__file__).parent.parent / "instances" / "tiny"
WORDS = [b"NaN", b"1e999", b"-1", b'"x"', b"null", b"1e-320", b"99999999999999999999", b"0", b"1000000000", b"1.5", b"[[[["]


@dataclass(frozen=True, slots=True)
class Seed:
    """A sound file: its name (the suffix says the format) and its bytes."""

    name: str
    content: bytes

    @property
    def load(self) -> Callable[[Path], object]:
        """What reads it."""
        return load_result if self.name.startswith("result") else load_instance


def seeds(folder: Path) -> list[Seed]:
    """The tiny instances as JSON and as archives, set-cover problems as text, and a result; written to `folder`."""
    tiny = {path.stem: load_instance(path) for path in sorted(TINY.glob("*.json"))}
    distance = (np.arange(6) - np.arange(5)[:, None]) % 6
    cover = Instance.of((distance < 3).astype(float), required=0.5, cost=[1, 2, 1, 3, 1, 1])
    for name, instance in tiny.items():
        save_instance(instance, folder / f"{name}.json")
        save_instance(instance, folder / f"{name}.npz")
    with np.load(folder / "two-piles.npz") as arrays:
        np.savez_compressed(folder / "deflated.npz", **arrays)
    for name in ("cover.txt", "cover.scp", "cover.rail"):
        save_instance(cover, folder / name)
    triples = "7 7\n1 2 3\n1 4 5\n1 6 7\n2 4 6\n2 5 7\n3 4 7\n3 5 6\n"
    (folder / "fano.sts").write_text(triples)
    (folder / "fano.txt").write_text(triples)
    for name in ("cliques", "infeasible-conflict"):
        save_result(solve(tiny[name], backend="highs"), folder / f"result-{name}.json")
    return [Seed(path.name, path.read_bytes()) for path in sorted(folder.iterdir())]


def mutate(content: bytes, rng: random.Random) -> bytes:
    """One to three damages of any kind; of an archive mostly within an array, with sums that fit again."""
    if content.startswith(b"PK") and rng.random() < 0.7:
        return _repacked(content, rng)
    for _ in range(rng.choice((1, 1, 1, 2, 3))):
        content = rng.choice(MUTATIONS)(content, rng)
    return content


def _repacked(content: bytes, rng: random.Random) -> bytes:
    damaged = io.BytesIO()
    with zipfile.ZipFile(io.BytesIO(content)) as old, zipfile.ZipFile(damaged, "w") as new:
        names = old.namelist()
        chosen, other = rng.choice(names), rng.choice(names)
        for name in names:
            array = old.read(other if name == chosen and rng.random() < 0.2 else name)
            new.writestr(name, mutate(array, rng) if name == chosen else array)
    return damaged.getvalue()


def _flip(content: bytes, rng: random.Random) -> bytes:
    if not content:
        return content
    at = rng.randrange(len(content))
    return content[:at] + bytes([content[at] ^ (1 << rng.randrange(8))]) + content[at + 1 :]


def _overwrite(content: bytes, rng: random.Random) -> bytes:
    at, length = rng.randrange(len(content) + 1), rng.randint(1, 8)
    return content[:at] + rng.choice((rng.randbytes(length), b"\xff" * length, bytes(length))) + content[at + length :]


def _truncate(content: bytes, rng: random.Random) -> bytes:
    return content[: rng.randrange(len(content) + 1)]


def _number(content: bytes, rng: random.Random) -> bytes:
    """Put a word in the place of a number."""
    return _replace(content, rb"-?\d+(\.\d+)?([eE][-+]?\d+)?", lambda _: rng.choice(WORDS), rng)


def _text(content: bytes, rng: random.Random) -> bytes:
    """Put a word in the place of a string or a list."""
    return _replace(content, rb'"[^"\n]*"|\[[^\[\]]*\]', lambda _: rng.choice((*WORDS, b"[]", b"{}", b'""', b"true")), rng)


def _swap(content: bytes, rng: random.Random) -> bytes:
    """Exchange two words."""
    words = list(re.finditer(rb"[\w.\-]+", content))
    if len(words) < 2:
        return content
    first, second = sorted(rng.sample(words, 2), key=lambda word: word.start())
    middle = content[first.end() : second.start()]
    return content[: first.start()] + second[0] + middle + first[0] + content[second.end() :]


def _lines(content: bytes, rng: random.Random) -> bytes:
    """Drop, double or exchange lines."""
    lines = content.splitlines(keepends=True) or [b""]
    at, other = rng.randrange(len(lines)), rng.randrange(len(lines))
    kind = rng.randrange(3)
    if kind == 0:
        del lines[at]
    elif kind == 1:
        lines.insert(other, lines[at])
    else:
        lines[at], lines[other] = lines[other], lines[at]
    return b"".join(lines)


def _insert(content: bytes, rng: random.Random) -> bytes:
    at = rng.randrange(len(content) + 1)
    return (
        content[:at] + rng.choice((*WORDS, b"[" * 20_000, b"9" * 5000, b" 7 7 7", b"\x00", b"\xef\xbb\xbf")) + content[at:]
    )


def _large(content: bytes, rng: random.Random) -> bytes:
    """Make a little-endian number huge: sizes in the headers of archives."""
    at = rng.randrange(len(content) + 1)
    return content[:at] + rng.choice((b"\xff\xff\xff\x7f", b"\xff" * 8, b"\x00\x00\x00\x80")) + content[at + 4 :]


def _shape(content: bytes, rng: random.Random) -> bytes:
    """Change the header of an array within an archive without changing its length."""
    choices = (
        (rb"<f8", b"|O8"),
        (rb"<i4", b"<f4"),
        (rb"<f8", b"<c8"),
        (rb"\((\d+),", None),
        (rb"False", b"True "),
        (rb"<f8", b">f8"),
    )
    pattern, new = rng.choice(choices)
    return _replace(content, pattern, lambda found: b"(" + b"9" * (len(found) - 2) + b"," if new is None else new, rng)


def _replace(content: bytes, pattern: bytes, new: Callable[[bytes], bytes], rng: random.Random) -> bytes:
    found = list(re.finditer(pattern, content))
    if not found:
        return content
    chosen = rng.choice(found)
    return content[: chosen.start()] + new(chosen[0]) + content[chosen.end() :]


MUTATIONS = (_flip, _overwrite, _truncate, _number, _text, _swap, _lines, _insert, _large, _shape)


def mutation(sound: list[Seed], seed: int, k: int) -> tuple[Seed, bytes]:
    """The k-th mutation: the file it was made of, and its content."""
    rng = random.Random(f"{seed}/{k}")
    chosen = sound[k % len(sound)]
    return chosen, mutate(chosen.content, rng)


def outcome(seed: Seed, content: bytes, folder: Path) -> str:
    """What reading the content does: "loaded", "refused", or what went wrong."""
    path = folder / f"mutated-{seed.name}"
    path.write_bytes(content)
    try:
        seed.load(path)
        said = "loaded"
    except PscoverError as error:
        said = "refused"
        if "more memory" in str(error):
            said = "no memory"
        elif str(path) not in str(error):
            said = f"no file name in: {error}"
    except Exception as error:
        said = f"{type(error).__name__}: {error}"
    changed = path.read_bytes() != content
    path.unlink()
    if changed or any(folder.iterdir()):
        said = "a file was written"
    return said


def read_all(folder: Path, seed: int, first: int, last: int) -> None:
    """In a process of its own: read mutations first..last - 1 and print the outcome of each."""
    sound = [Seed(path.name, path.read_bytes()) for path in sorted(folder.iterdir())]
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
    with tempfile.TemporaryDirectory() as work:
        for k in range(first, last):
            chosen, content = mutation(sound, seed, k)
            print(json.dumps([k, outcome(chosen, content, Path(work))]), flush=True)


def watch(folder: Path, seed: int, first: int, last: int) -> tuple[list[str], str]:
    """Outcomes of a reading process until it ends or stays silent too long, and how it ended."""
    arguments = [sys.executable, __file__, "--read", str(folder), str(seed), str(first), str(last)]
    outcomes: list[str] = []
    with subprocess.Popen(arguments, stdout=subprocess.PIPE, bufsize=0) as process, selectors.DefaultSelector() as selector:
        assert process.stdout is not None
        selector.register(process.stdout, selectors.EVENT_READ)
        # The first answer waits for the imports too.
        while selector.select(timeout=SECONDS if outcomes else SECONDS + 30):
            line = process.stdout.readline()
            if not line:
                return outcomes, "ended" if process.wait() == 0 else f"died with status {process.returncode}"
            outcomes.append(json.loads(line)[1])
        process.kill()
    return outcomes, f"hung for {SECONDS} s"


def main() -> int:
    """Run the mutations and print the counts."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--mutations", type=int, default=10_000)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--read", nargs=4, metavar=("FOLDER", "SEED", "FIRST", "LAST"), help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.read:
        read_all(Path(given.read[0]), *map(int, given.read[1:]))
        return 0
    begun = time.perf_counter()
    counts: Counter[tuple[str, str]] = Counter()
    bad = 0
    with tempfile.TemporaryDirectory() as folder:
        sound = seeds(Path(folder))
        k = 0
        while k < given.mutations:
            outcomes, end = watch(Path(folder), given.seed, k, given.mutations)
            if end != "ended":
                outcomes.append(end)
            for said in outcomes:
                kind = said if said in ("loaded", "refused") else "BAD"
                counts[Path(sound[k % len(sound)].name).suffix, kind] += 1
                if kind == "BAD":
                    bad += 1
                    print(f"mutation {k} of {sound[k % len(sound)].name}: {said}")
                k += 1
    for (suffix, kind), count in sorted(counts.items()):
        print(f"{suffix:6} {kind:8} {count}")
    total = sum(counts.values())
    seconds = time.perf_counter() - begun
    print(f"{total} mutations, {bad} bad, {seconds:.0f} s, seed {given.seed}, {MEMORY // 2**20} MiB of memory")
    return 1 if bad else 0


if __name__ == "__main__":
    sys.exit(main())
