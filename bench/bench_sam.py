"""Guided prompting against the published mask generator: the same MobileSAM weights in the same onnxruntime, on one core.

pytest bench/bench_sam.py

The generator is `SamAutomaticMaskGenerator` of segment-anything with its published settings (32 x 32 points); encoder and
decoder under it are the two ONNX files, which favours it: in torch the decoder takes longer. Both results go through the
same clean-up. The columns: CPU seconds of each; "iou" is the area-weighted mean, over the segments of the generator, of the
best intersection over union with a guided segment; "garment_iou" the same over the segments that hold a mark, each against
the guided segment under the same mark; "found" counts garments, marked by eye, that are alone in a segment.

The generator takes some three CPU minutes a photo; `-k 244` measures one. With --benchmark-disable it is left out.
"""

# torch is not looked into when types are checked: its classes are of no known type.
# mypy: disallow-subclassing-any=False

from __future__ import annotations

import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from pscover.perception.generators import Generated
from pscover.perception.marks import MarkedPhoto, read_marks, tally
from pscover.perception.models import DECODER, ENCODER, locate
from pscover.perception.onnx_sam import OnnxSam
from pscover.perception.perceive import Perception, perceive
from pscover.perception.segmenters.mobile_sam import MobileSam

ROOT = Path(__file__).parents[1]
SHARED = ROOT.parent / "shared"
MARKS = {photo.file: photo for photo in read_marks(ROOT / "instances" / "photos" / "marks.json")}
QUICK = "tshirts_0_ex2.png"
"""Enough to see that it runs."""
PAPER_SECONDS = 18.7


@pytest.fixture(autouse=True)
def weights(monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("onnxruntime")
    pytest.importorskip("cv2")
    if not (SHARED / "weights" / ENCODER.file).is_file() or not (SHARED / "photos").is_dir():
        pytest.skip("MobileSAM's weights and the photos are not shipped: put them into ../shared")
    monkeypatch.setenv("PSCOVER_MODELS", str(SHARED / "weights"))


@dataclass(kw_only=True)
class Meter:
    """CPU seconds of the parts of the published generator."""

    seconds: dict[str, float] = field(default_factory=dict)

    def run(self, part: str, session: Any, feed: dict[str, NDArray[np.float32]]) -> list[Any]:
        began = time.process_time()
        answer: list[Any] = session.run(None, feed)
        self.seconds[part] = self.seconds.get(part, 0.0) + time.process_time() - began
        return answer


def published(model: OnnxSam, meter: Meter, points_per_side: int) -> Any:
    """`SamAutomaticMaskGenerator` over an encoder and a decoder in ONNX."""
    from pscover.perception.torchvision_stand_in import segment_anything

    package = segment_anything()
    import torch
    from segment_anything.modeling import Sam

    class Encoder(torch.nn.Module):
        img_size = model.side

        def forward(self, x: Any) -> Any:
            return torch.from_numpy(meter.run("encoder", model.encoder, {"x": x.numpy()})[0])

    class Prompts(torch.nn.Module):
        def forward(self, points: Any, boxes: Any, masks: Any) -> Any:
            return points[0], None

        def get_dense_pe(self) -> None:
            return None

    class Decoder(torch.nn.Module):
        def forward(self, image_embeddings: Any, sparse_prompt_embeddings: Any, **_: Any) -> Any:
            points = sparse_prompt_embeddings.numpy().astype(np.float32)
            labels = np.ones(points.shape[:2], dtype=np.float32)
            feed = {"emb": image_embeddings.numpy(), "pts": points, "lab": labels}
            return tuple(map(torch.from_numpy, meter.run("decoder", model.decoder, feed)))

    torch.set_num_threads(1)
    sam = Sam(Encoder(), Prompts(), Decoder(), [123.675, 116.28, 103.53], [58.395, 57.12, 57.375])
    return package.SamAutomaticMaskGenerator(sam, points_per_side=points_per_side, points_per_batch=16)


def agreement(reference: NDArray[np.int32], labels: NDArray[np.int32]) -> float:
    """Area-weighted mean, over the reference's segments, of the best intersection over union."""
    total = weighted = 0.0
    for value in np.unique(reference[reference > 0]):
        segment = reference == value
        area = int(np.count_nonzero(segment))
        best = max(
            int(np.count_nonzero(segment & (labels == other))) / int(np.count_nonzero(segment | (labels == other)))
            for other in np.unique(labels[segment])
        )
        total, weighted = total + area, weighted + area * (best if labels[segment].any() else 0.0)
    return weighted / total


def garment_agreement(reference: NDArray[np.int32], labels: NDArray[np.int32], photo: MarkedPhoto) -> float:
    """Area-weighted mean intersection over union of the two segments under each mark; 0 for a mark on the surface."""
    pairs = {(int(reference[click.y, click.x]), int(labels[click.y, click.x])) for click in photo.garments}
    total = weighted = 0.0
    for one, two in pairs:
        first, second = (reference == one) & (one > 0), (labels == two) & (two > 0)
        area = max(1, int(np.count_nonzero(first)))
        shared = int(np.count_nonzero(first & second)) / max(1, int(np.count_nonzero(first | second)))
        total, weighted = total + area, weighted + area * shared
    return weighted / total


def look(photo: MarkedPhoto, segmenter: Any) -> Perception:
    return perceive(SHARED / "photos" / photo.file, segmenter=segmenter, roi=photo.roi)


@pytest.mark.parametrize("name", MARKS)
def bench_guided(benchmark: Any, row: Any, name: str) -> None:
    if benchmark.disabled and name != QUICK:
        pytest.skip("one photo is enough to see that it runs")
    photo = MARKS[name]
    MobileSam().segment(np.zeros((8, 8, 3), dtype=np.uint8), np.ones((8, 8), dtype=np.bool_))
    seen = benchmark.pedantic(look, (photo, MobileSam()), rounds=1)
    counts = tally(seen.labels, photo)
    spent = {stage.name: stage.cpu_seconds for stage in seen.stages}
    whole = sum(spent[stage] for stage in ("encoder", "decoder", "post-processing"))
    row(
        "Guided MobileSAM: CPU seconds a photo, one thread",
        photo=name,
        encoder=spent["encoder"],
        decoder=spent["decoder"],
        post=spent["post-processing"],
        segmentation=whole,
        of_the_paper=whole / PAPER_SECONDS,
        garments=len(photo.garments),
        found=len(counts.found),
        merged=len(counts.merged),
        missed=len(counts.missed),
        extra=counts.extra,
    )
    assert counts.segments > 0


@pytest.mark.parametrize("name", MARKS)
def bench_against_the_published_generator(benchmark: Any, row: Any, name: str) -> None:
    if benchmark.disabled:
        pytest.skip("the published generator takes minutes")
    photo, meter = MARKS[name], Meter()
    model = OnnxSam.load(locate(ENCODER), locate(DECODER), threads=1)
    ours = look(photo, MobileSam())
    generator = Generated(generator=published(model, meter, 32))
    theirs = benchmark.pedantic(look, (photo, generator), rounds=1)
    (whole,) = (stage.cpu_seconds for stage in theirs.stages if stage.name == "generator")
    spent = {stage.name: stage.cpu_seconds for stage in ours.stages}
    guided = sum(spent[stage] for stage in ("encoder", "decoder", "post-processing"))
    row(
        "Guided against the published generator: CPU seconds, one thread",
        photo=name,
        amg=whole,
        amg_encoder=meter.seconds["encoder"],
        amg_decoder=meter.seconds["decoder"],
        amg_post=whole - sum(meter.seconds.values()),
        guided=guided,
        encoder=spent["encoder"],
        decoder=spent["decoder"],
        post=spent["post-processing"],
        times=whole / guided,
        iou=agreement(theirs.labels, ours.labels),
        garment_iou=garment_agreement(theirs.labels, ours.labels, photo),
        amg_found=len(tally(theirs.labels, photo).found),
        found=len(tally(ours.labels, photo).found),
        garments=len(photo.garments),
    )
