"""MobileSAM (Zhang et al. 2023, arXiv 2306.14289) by onnxruntime, prompted only where there is cloth; no torch.

About 3 to 6 seconds of CPU for a photo, whatever its size: the encoder costs the same for every photo, and each prompt a
tenth of a second. `pscover.perception.guided` says how prompts are chosen.

The two files are made from the official `mobile_sam.pt` by `pscover models export`. They are looked for in
$PSCOVER_MODELS, ./models and ~/.cache/pscover, and must have a known digest: see `pscover.perception.models`, also for
weights of one's own. Nothing is downloaded.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from pscover.errors import InvalidSettings
from pscover.perception.guided import Guide, segment_guided
from pscover.perception.models import DECODER, ENCODER, locate
from pscover.perception.onnx_sam import OnnxSam
from pscover.perception.segmenter import Segmentation

STANDARD = Guide()


@dataclass(frozen=True, slots=True, kw_only=True)
class MobileSam:
    """MobileSAM by onnxruntime, prompted only where there is cloth.

    Parameters
    ----------
    encoder, decoder
        Paths of the ONNX files; by default `mobile_sam_encoder.onnx` and `mobile_sam_decoder.onnx` where weights are looked
        for.
    threads
        Threads of onnxruntime.
    prompts
        The most points a photo is asked about.
    covered
        Stop when this share of the cloth is explained.
    min_iou, min_stability
        What a mask must have of the model's own guess of its quality, and of stability.

    Raises
    ------
    InvalidSettings
        If a setting is outside its domain.
    """

    encoder: str = ""
    decoder: str = ""
    threads: int = 1
    prompts: int = STANDARD.prompts
    covered: float = STANDARD.covered
    min_iou: float = STANDARD.min_iou
    min_stability: float = STANDARD.min_stability

    name: ClassVar[str] = "mobile-sam"
    requires: ClassVar[tuple[str, ...]] = ("onnxruntime", "cv2")
    extra: ClassVar[str] = "mobile-sam"

    def __post_init__(self) -> None:
        if self.threads < 1:
            raise InvalidSettings(f"threads: expected at least 1, got {self.threads}")
        self._guide()

    def segment(self, photo: NDArray[np.uint8], cloth: NDArray[np.bool_]) -> Segmentation:
        """Masks of the garments, with the time of the encoder, the decoder and the post-processing.

        Parameters
        ----------
        photo
            RGB, shape (H, W, 3).
        cloth
            Which pixels show cloth, shape (H, W): prompts go only there.

        Raises
        ------
        InvalidSettings
            If the files are not found or nobody vouches for them.
        InvalidImage
            If photo or cloth map have the wrong shape or type, or a file is no such model.
        MissingDependency
            Without onnxruntime or OpenCV.
        """
        model = OnnxSam.load(locate(ENCODER, self.encoder), locate(DECODER, self.decoder), self.threads)
        return segment_guided(model, photo, cloth, self._guide())

    def _guide(self) -> Guide:
        return Guide(prompts=self.prompts, covered=self.covered, min_iou=self.min_iou, min_stability=self.min_stability)


segmenter = MobileSam
