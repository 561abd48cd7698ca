"""Segment Anything (Kirillov et al. 2023, arXiv 2304.02643) by torch and the package segment-anything.

Mode "guided" prompts only where there is cloth (`pscover.perception.guided`); mode "amg" is the paper's way: the published
SamAutomaticMaskGenerator with its published settings, a grid of points over the whole photo. On one core of a CPU, ViT-B
takes about 22 seconds for the encoder and 0.2 seconds a point, so "amg" takes minutes. "guided" on a CPU is better served by
the segmenter "mobile-sam".

The checkpoint is one of the official ones (ViT-B, as in the paper, -L, -H, or MobileSAM); its structure is read off the
weights. It must have a known digest: see `pscover.perception.models`, also for weights of one's own. Nothing is downloaded,
and only tensors are read from the file. torchvision is not needed.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar, Literal

import numpy as np
from numpy.typing import NDArray

from pscover.errors import InvalidSettings
from pscover.perception.generators import masks_of_generated
from pscover.perception.guided import Guide, segment_guided
from pscover.perception.models import CATALOGUE, VIT_B, locate, vouched
from pscover.perception.promptable import checked
from pscover.perception.segmenter import Segmentation
from pscover.perception.stopwatch import Stopwatch
from pscover.perception.torch_sam import TorchSam, torch_threads
from pscover.perception.torchvision_stand_in import segment_anything

STANDARD = Guide()


@dataclass(frozen=True, slots=True, kw_only=True)
class Sam:
    """Segment Anything by torch: prompted only where there is cloth, or by the published grid.

    Parameters
    ----------
    checkpoint
        Path of the weights; by default `sam_vit_b_01ec64.pth` where weights are looked for.
    mode
        "guided", or "amg" as published.
    device
        "cpu", "cuda", "cuda:<number>", or "auto": CUDA where there is any. In single precision everywhere. CUDA is tested
        with stand-ins for a device alone, never on one.
    threads
        Threads of torch on the CPU.
    prompts
        Guided: the most points a photo is asked about.
    covered
        Guided: stop when this share of the cloth is explained.
    points_per_side
        AMG: the grid has the square of this many points.
    points_per_batch
        AMG: points decoded at a time. Fewer take less memory (64 take 3 GB) and on a CPU no longer.
    crop_n_layers
        AMG: layers of crops of the photo that are searched too.
    min_iou, min_stability
        What a mask must have of the model's own guess of its quality, and of stability. None stands for the mode's own: as
        published for "amg" (0.88, 0.95), lower for "guided".

    Raises
    ------
    InvalidSettings
        If a setting is outside its domain.
    """

    checkpoint: str = ""
    mode: Literal["guided", "amg"] = "guided"
    device: str = "cpu"
    threads: int = 1
    prompts: int = STANDARD.prompts
    covered: float = STANDARD.covered
    points_per_side: int = 32
    points_per_batch: int = 64
    crop_n_layers: int = 0
    min_iou: float | None = None
    min_stability: float | None = None

    name: ClassVar[str] = "sam"
    requires: ClassVar[tuple[str, ...]] = ("torch", "segment_anything", "cv2")
    extra: ClassVar[str] = "sam"

    def __post_init__(self) -> None:
        if self.mode not in ("guided", "amg"):
            raise InvalidSettings(f'mode: expected "guided" or "amg", got {self.mode!r}')
        for name in ("threads", "points_per_side", "points_per_batch"):
            if getattr(self, name) < 1:
                raise InvalidSettings(f"{name}: expected at least 1, got {getattr(self, name)}")
        if self.crop_n_layers < 0:
            raise InvalidSettings(f"crop_n_layers: expected at least 0, got {self.crop_n_layers}")
        self._guide()

    def segment(self, photo: NDArray[np.uint8], cloth: NDArray[np.bool_]) -> Segmentation:
        """Masks of the garments.

        Parameters
        ----------
        photo
            RGB, shape (H, W, 3).
        cloth
            Which pixels show cloth, shape (H, W). Mode "amg" does not look at it: its masks are of everything in the photo.

        Returns
        -------
        Segmentation
            With the time of the stages "encoder", "decoder" and "post-processing", or of "generator" in mode "amg".

        Raises
        ------
        InvalidSettings
            If the checkpoint is not found or nobody vouches for it.
        InvalidImage
            If photo or cloth map have the wrong shape or type, or the checkpoint is none.
        Refused
            If the device is not there.
        MissingDependency
            Without torch, segment-anything or OpenCV.
        """
        photo, cloth = checked(photo, cloth)
        model = TorchSam.load(self._path(), self.device)
        with torch_threads(self.threads):
            if self.mode == "guided":
                return segment_guided(model, photo, cloth, self._guide())
            return self._generate(model.model, photo)

    def _path(self) -> Path:
        if not self.checkpoint:
            return locate(VIT_B)
        known = tuple(digest for weights in CATALOGUE for digest in weights.digests)
        return vouched(Path(self.checkpoint).expanduser(), known)

    def _guide(self) -> Guide:
        iou = STANDARD.min_iou if self.min_iou is None else self.min_iou
        stable = STANDARD.min_stability if self.min_stability is None else self.min_stability
        return Guide(prompts=self.prompts, covered=self.covered, min_iou=iou, min_stability=stable)

    def _generate(self, model: Any, photo: NDArray[np.uint8]) -> Segmentation:
        watch = Stopwatch()
        with watch.stage("generator"):
            records = self._generator(model).generate(photo)
        return Segmentation(masks=masks_of_generated(records, photo.shape[:2]), stages=watch.stages)

    def _generator(self, model: Any) -> Any:
        """The published generator; settings left at None stay its own."""
        thresholds = {"pred_iou_thresh": self.min_iou, "stability_score_thresh": self.min_stability}
        return segment_anything().SamAutomaticMaskGenerator(
            model,
            points_per_side=self.points_per_side,
            points_per_batch=self.points_per_batch,
            crop_n_layers=self.crop_n_layers,
            **{name: value for name, value in thresholds.items() if value is not None},
        )


segmenter = Sam
