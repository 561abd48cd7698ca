"""Where weights are looked for, which are trusted, and what is said when there are none."""

from __future__ import annotations

import hashlib
from pathlib import Path

import pytest

from pscover import registry
from pscover.errors import InvalidSettings
from pscover.perception import models
from pscover.perception.models import DECODER, ENCODER, MOBILE_SAM, digest, find, folders, locate, vouch, vouched


@pytest.fixture(autouse=True)
def nowhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("HOME", str(tmp_path / "home"))
    monkeypatch.delenv(models.FOLDER_VARIABLE, raising=False)


def test_folders_in_their_order(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    usual = (Path("models"), tmp_path / "home" / ".cache" / "pscover")
    assert folders() == usual
    monkeypatch.setenv(models.FOLDER_VARIABLE, "/somewhere")
    assert folders() == (Path("/somewhere"), *usual)


def test_the_first_folder_that_has_the_file_wins(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("models", "mine"):
        (tmp_path / name).mkdir()
        (tmp_path / name / ENCODER.file).write_bytes(name.encode())
    assert find(ENCODER) == Path("models") / ENCODER.file
    monkeypatch.setenv(models.FOLDER_VARIABLE, str(tmp_path / "mine"))
    assert find(ENCODER) == tmp_path / "mine" / ENCODER.file
    assert find(DECODER) is None


def test_the_message_says_where_weights_come_from() -> None:
    with pytest.raises(InvalidSettings) as caught:
        locate(ENCODER)
    message = str(caught.value)
    assert all(part in message for part in ("models export", "Apache-2.0", "PSCOVER_MODELS", "Nothing is downloaded"))
    assert all(part in message for part in (MOBILE_SAM.digests[0], "FOLDER/mobile_sam.pt"))
    with pytest.raises(InvalidSettings, match=MOBILE_SAM.digests[0]):
        locate(MOBILE_SAM)


def test_a_file_is_taken_only_with_a_digest_that_somebody_vouches_for(tmp_path: Path) -> None:
    path = tmp_path / "own.onnx"
    path.write_bytes(b"weights")
    with pytest.raises(InvalidSettings, match=r"expected SHA-256 f516.*sha256sum own\.onnx >> SHA256SUMS"):
        locate(ENCODER, str(path))
    (tmp_path / "SHA256SUMS").write_bytes(b"a line that is none\n" + vouch(path))
    assert locate(ENCODER, str(path)) == path
    path.write_bytes(b"other weights")
    with pytest.raises(InvalidSettings, match="damaged or another one"):
        locate(ENCODER, str(path))


def test_vouching_for_one_file_is_not_vouching_for_another(tmp_path: Path) -> None:
    one, two = tmp_path / "one.onnx", tmp_path / "two.onnx"
    one.write_bytes(b"weights")
    two.write_bytes(b"weights")
    (tmp_path / "SHA256SUMS").write_bytes(vouch(one))
    assert vouched(one, ()) == one
    with pytest.raises(InvalidSettings, match="two"):
        vouched(two, ())


def test_a_digest_follows_the_content_of_the_file(tmp_path: Path) -> None:
    path = tmp_path / "file"
    for content in (b"one", b"three"):
        path.write_bytes(content)
        assert digest(path) == hashlib.sha256(content).hexdigest()


@pytest.mark.parametrize("name", ["absent.onnx", "."])
def test_a_missing_file_and_a_folder_are_our_errors(name: str) -> None:
    with pytest.raises(InvalidSettings, match="expected a file"):
        locate(ENCODER, name)


def test_both_segmenters_are_registered_with_their_parameters() -> None:
    mobile = registry.make("segmenter", "mobile-sam", {"threads": "2", "prompts": "12", "covered": "0.9"})
    assert (mobile.threads, mobile.prompts, mobile.covered) == (2, 12, 0.9)
    sam = registry.make("segmenter", "sam", {"mode": "amg", "points_per_side": "8", "min_iou": "0.5"})
    assert (sam.mode, sam.points_per_side, sam.min_iou) == ("amg", 8, 0.5)


@pytest.mark.parametrize(
    ("name", "options"),
    [
        ("mobile-sam", {"threads": "0"}),
        ("mobile-sam", {"prompts": "many"}),
        ("mobile-sam", {"covered": "2"}),
        ("sam", {"mode": "everything"}),
        ("sam", {"points_per_side": "0"}),
        ("sam", {"crop_n_layers": "-1"}),
    ],
)
def test_parameters_outside_their_domain_are_refused(name: str, options: dict[str, str]) -> None:
    with pytest.raises(InvalidSettings, match=next(iter(options))):
        registry.make("segmenter", name, options)
