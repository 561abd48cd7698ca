"""Label arrays and image files: what becomes a scene, and what is refused with which words."""

from __future__ import annotations

import struct
import zlib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from pscover import InvalidImage
from pscover.images import PNG_SIGNATURE, read_labels, read_photo
from pscover.scene import Scene

PHOTOS = Path(__file__).parents[1] / "instances" / "photos"


def test_labels_need_not_be_contiguous() -> None:
    scene = Scene.of(np.array([[0, 900, 5], [5, 0, 0]], dtype=np.uint16))
    assert scene.values.tolist() == [5, 900]
    assert scene.segments.tolist() == [[-1, 1, 0], [0, -1, -1]]
    assert scene.areas().tolist() == [2, 1]
    assert scene.names == ("garment 5", "garment 900")
    assert scene.labels.dtype == np.int32


def test_huge_label_values_need_no_huge_table() -> None:
    scene = Scene.of(np.array([[2**31 - 1, 7]]))
    assert scene.values.tolist() == [7, 2**31 - 1]
    assert scene.segments.tolist() == [[1, 0]]


def test_a_scene_owns_read_only_copies() -> None:
    labels = np.ones((3, 4), dtype=np.int32)
    photo = np.zeros((3, 4, 3), dtype=np.uint8)
    scene = Scene.of(labels, photo=photo)
    labels[:] = 0
    photo[:] = 9
    assert scene.labels.all()
    assert scene.photo is not None
    assert not scene.photo.any()
    for buffer in (scene.labels, scene.values, scene.segments, scene.photo):
        with pytest.raises(ValueError, match="read-only"):
            buffer[:] = 0


def test_an_empty_table_is_a_scene() -> None:
    scene = Scene.of(np.zeros((2, 3), dtype=int))
    assert (scene.garments, scene.areas().tolist(), scene.names) == (0, [], ())


def test_the_basket_stands_at_the_right_edge_unless_told() -> None:
    assert Scene.of(np.zeros((11, 21), dtype=int)).basket == (20.0, 5.0)
    assert Scene.of(np.zeros((11, 21), dtype=int), basket=(-5, 3)).basket == (-5.0, 3.0)


@pytest.mark.parametrize(
    ("labels", "words"),
    [
        ([1, 2], r"expected shape \(H, W\), got \(2,\)"),
        (np.zeros((2, 2, 3), dtype=int), "a colour image is no label image"),
        (np.zeros((0, 5), dtype=int), "at least one pixel"),
        ([[0.0, 1.0]], "whole numbers, got float64"),
        ([[0, 1], [0, -3]], "x=1, y=1: expected a label from 0 to 2147483647, got -3"),
        (np.array([[2**40]]), "got 1099511627776"),
        ([[1, 2], [3]], "expected whole numbers of shape"),
        ([["a"]], "whole numbers"),
        (np.broadcast_to(np.int8(0), (2**14, 2**13)), "at most 67108864 pixels"),
    ],
)
def test_what_is_no_label_image(labels: Any, words: str) -> None:
    with pytest.raises(InvalidImage, match=words):
        Scene.of(labels)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"names": ["one", "two"]}, "names: expected 1, one a garment, got 2"),
        ({"pixels_per_cm": 0}, "pixels_per_cm: expected a positive number, got 0"),
        ({"pixels_per_cm": float("nan")}, "pixels_per_cm"),
        ({"basket": (float("inf"), 0)}, "basket: expected finite"),
        ({"photo": np.zeros((2, 2), dtype=np.uint8)}, "photo: expected 8-bit RGB"),
        ({"photo": np.zeros((3, 2, 3), dtype=np.uint8)}, "expected the labels' size 2 x 2, got 2 x 3"),
    ],
)
def test_what_does_not_fit_the_labels(options: dict[str, Any], words: str) -> None:
    with pytest.raises(InvalidImage, match=words):
        Scene.of(np.ones((2, 2), dtype=int), **options)


def encoded(image: NDArray[Any], kind: str = ".png") -> bytes:
    cv2 = pytest.importorskip("cv2")
    return bytes(cv2.imencode(kind, image)[1].tobytes())


def png(width: int, height: int, bits: int, colour_type: int, content: bytes) -> bytes:
    """A PNG of three chunks with right checksums, whatever they say."""

    def chunk(kind: bytes, data: bytes) -> bytes:
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    header = struct.pack(">IIBBBBB", width, height, bits, colour_type, 0, 0, 0)
    palette = chunk(b"PLTE", bytes(6)) if colour_type == 3 else b""
    return PNG_SIGNATURE + chunk(b"IHDR", header) + palette + chunk(b"IDAT", zlib.compress(content)) + chunk(b"IEND", b"")


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
def test_grey_pngs_keep_every_label(tmp_path: Path, dtype: Any) -> None:
    labels = np.arange(240, dtype=dtype).reshape(12, 20) * (1 if dtype is np.uint8 else 270)
    file = tmp_path / "étiquettes 标签.png"
    file.write_bytes(encoded(labels))
    assert (read_labels(file) == labels).all()
    scene = Scene.read(file)
    assert scene.source == str(file)
    assert scene.garments == 239


SOUND = png(2, 2, 8, 0, b"\0\1\2\0\3\4")


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"", "expected an image, got an empty file"),
        (b"hello, world", "expected a PNG file with labels, got something else"),
        (b"\xff\xd8\xff\xe0JFIF", "a JPEG, which does not keep values exact"),
        (SOUND[:20], "cut off before the end of its header"),
        (SOUND[:-14], "cut off at byte"),
        (SOUND[:40] + b"\xff" + SOUND[41:], "damaged"),
        (SOUND[:45] + b"\xff" + SOUND[46:], "checksum of the part b'IDAT'"),
        (png(2, 2, 8, 2, bytes(14)), r"got colour \(RGB\) of 8 bits"),
        (png(2, 2, 8, 6, bytes(18)), "got colour with alpha"),
        (png(2, 2, 8, 3, bytes(6)), "got palette of 8 bits"),
        (png(8, 1, 1, 0, bytes(2)), "got grey of 1 bits"),
        (png(2, 2, 8, 0, bytes(5)), "fewer pixels than its header declares"),
        (png(2, 2, 8, 0, bytes(10**6)), "more pixels than its header declares"),
        (png(100_000, 100_000, 8, 0, bytes(10)), "at most 67108864 pixels, got 100000 x 100000"),
        (png(0, 5, 8, 0, b""), "at least one pixel, got 0 x 5"),
    ],
)
def test_what_is_no_label_file(tmp_path: Path, content: bytes, words: str) -> None:
    file = tmp_path / "labels.png"
    file.write_bytes(content)
    with pytest.raises(InvalidImage, match=words) as caught:
        read_labels(file)
    assert str(file) in str(caught.value)


def test_where_there_is_no_file(tmp_path: Path) -> None:
    with pytest.raises(InvalidImage, match="no such file"):
        read_labels(tmp_path / "none.png")
    with pytest.raises(InvalidImage, match="directory"):
        read_labels(tmp_path)


def test_every_cut_of_a_label_file_is_refused(tmp_path: Path) -> None:
    whole = encoded(np.arange(100, dtype=np.uint16).reshape(10, 10))
    file = tmp_path / "labels.png"
    for length in range(len(whole)):
        file.write_bytes(whole[:length])
        with pytest.raises(InvalidImage):
            read_labels(file)


def test_photos_are_rgb(tmp_path: Path) -> None:
    red = np.zeros((20, 30, 3), dtype=np.uint8)
    red[..., 2] = 255
    for kind in (".png", ".jpg"):
        file = tmp_path / f"photo{kind}"
        file.write_bytes(encoded(red, kind))
        photo = read_photo(file)
        assert photo.shape == (20, 30, 3)
        assert photo[..., 0].min() > 250
        assert photo[..., 1:].max() < 5


def test_photos_are_distrusted(tmp_path: Path) -> None:
    whole = encoded(np.random.default_rng(0).integers(0, 255, (60, 60, 3), dtype=np.uint8), ".jpg")
    frame = whole.index(b"\xff\xc0") + 5
    file = tmp_path / "photo.jpg"
    for content, words in (
        (whole[:-200], "cut off or damaged"),
        (whole[:300], "cut off or damaged"),
        (whole[:frame] + b"\xff\xff\xff\xff" + whole[frame + 4 :], "at most 67108864 pixels, got 65535 x 65535"),
        (b"GIF89a", "expected a JPEG or PNG photo"),
        (png(90_000, 90_000, 8, 2, bytes(10)), "at most 67108864 pixels"),
    ):
        file.write_bytes(content)
        with pytest.raises(InvalidImage, match=words):
            read_photo(file)


def test_decoders_say_nothing(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    """OpenCV's print on standard error what they think of damaged pixels and of colour profiles."""
    picture = np.random.default_rng(0).integers(0, 255, (60, 60, 3), dtype=np.uint8)
    whole = encoded(picture, ".jpg")
    middle = len(whole) // 2
    profile = b"iCCPicc\0\0" + zlib.compress(b"no profile")
    chunk = struct.pack(">I", len(profile) - 4) + profile + struct.pack(">I", zlib.crc32(profile))
    for name, content in (
        ("cut.jpg", whole[:middle] + b"\xff\xd9"),
        ("extra.jpg", whole[:middle] + bytes(300) + whole[middle:]),
        ("exif.jpg", whole[:2] + b"\xff\xe1\x00\x0cExif\0\0II*\0" + whole[2:]),
        ("profile.png", (plain := encoded(picture))[:33] + chunk + plain[33:]),
    ):
        (tmp_path / name).write_bytes(content)
        assert read_photo(tmp_path / name).shape == (60, 60, 3)
    content = encoded(picture[:, :, 0])
    (tmp_path / "labels.png").write_bytes(content[:33] + chunk + content[33:])
    assert (read_labels(tmp_path / "labels.png") == picture[:, :, 0]).all()
    (tmp_path / "filter.png").write_bytes(png(2, 2, 8, 0, b"\x09\1\2\x09\3\4"))
    with pytest.raises(InvalidImage, match="cannot be decoded"):
        read_labels(tmp_path / "filter.png")
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize("orientation", range(1, 9))
def test_photos_are_turned_upright(tmp_path: Path, orientation: int) -> None:
    image = pytest.importorskip("PIL.Image")
    corner = np.zeros((40, 60, 3), dtype=np.uint8)
    corner[:16, :24] = 255
    exif = image.Exif()
    exif[0x0112] = orientation
    for name in ("photo.jpg", "photo.png"):
        image.fromarray(corner).save(tmp_path / name, exif=exif)
        photo = read_photo(tmp_path / name)
        rows, columns = np.nonzero(photo[:, :, 0] > 128)
        assert photo.shape == ((40, 60, 3) if orientation < 5 else (60, 40, 3))
        assert (rows.min() == 0) == (orientation in (1, 2, 5, 6))
        assert (columns.min() == 0) == (orientation in (1, 4, 5, 8))


def test_grey_photos_of_16_bits_keep_their_contrast(tmp_path: Path) -> None:
    grey = np.linspace(0, 65535, 600).astype(np.uint16).reshape(20, 30)
    (tmp_path / "grey.png").write_bytes(encoded(grey))
    assert (read_photo(tmp_path / "grey.png")[:, :, 1] == grey >> 8).all()


@pytest.mark.skipif(not PHOTOS.is_dir(), reason="the sources are not here")
@pytest.mark.parametrize(("name", "garments"), [("tshirts_0_ex2", 6), ("tshirts_244_color", 9), ("tshirts_363_color", 8)])
def test_the_shipped_photos_have_labels(name: str, garments: int) -> None:
    pytest.importorskip("cv2")
    scene = Scene.read(PHOTOS / f"{name}.labels.png", photo=PHOTOS / f"{name}.jpg")
    assert scene.garments == garments
    assert scene.values.tolist() == list(range(1, garments + 1))
    assert name in (PHOTOS / "SOURCES.tsv").read_text()
