"""MobileSAM's real weights on a real photo; skipped where ../shared/weights is absent."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from pscover.perception.models import DECODER, ENCODER, MOBILE_SAM, vouched
from pscover.perception.segmenters.mobile_sam import MobileSam

ROOT = Path(__file__).parents[1]
WEIGHTS = ROOT.parent / "shared" / "weights"
PHOTOS = ROOT / "instances" / "photos"
for needed in (WEIGHTS / ENCODER.file, WEIGHTS / DECODER.file, PHOTOS / "tshirts_0_ex2.jpg"):
    if not needed.is_file():
        pytest.skip(f"needs {needed.parent.name}/{needed.name}, which is not shipped", allow_module_level=True)
pytest.importorskip("onnxruntime")
cv2 = pytest.importorskip("cv2")


def test_three_shirts_are_three_masks(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PSCOVER_MODELS", str(WEIGHTS))
    photo = cv2.imread(str(PHOTOS / "tshirts_0_ex2.jpg"))[:, :, ::-1]
    labels = cv2.imread(str(PHOTOS / "tshirts_0_ex2.labels.png"), cv2.IMREAD_UNCHANGED)
    found = MobileSam(prompts=32).segment(photo, labels > 0)
    largest = np.argsort(-np.bincount(labels.ravel())[1:])[:3] + 1
    for label in largest:
        truth = labels == label
        overlaps = [mask.pixels(truth.shape) for mask in found.masks]
        best = max(np.count_nonzero(each & truth) / np.count_nonzero(each | truth) for each in overlaps)
        assert best > 0.8, f"label {label}: best intersection over union {best:.2f}"


def test_the_encoder_written_for_pscover_is_mobile_sam_s() -> None:
    torch = pytest.importorskip("torch")
    import onnxruntime

    from pscover.perception.tiny_vit import tiny_vit

    path = vouched(WEIGHTS / MOBILE_SAM.file, MOBILE_SAM.digests)
    state = torch.load(path, map_location="cpu", weights_only=True)
    encoder = tiny_vit({name[14:]: value for name, value in state.items() if name.startswith("image_encoder.")})
    photo = np.random.default_rng(0).standard_normal((1, 3, 1024, 1024)).astype(np.float32)
    (expected,) = onnxruntime.InferenceSession(str(WEIGHTS / ENCODER.file)).run(None, {"x": photo})
    with torch.inference_mode():
        got = encoder(torch.from_numpy(photo)).numpy()
    assert np.abs(got - expected).max() < 1e-4
