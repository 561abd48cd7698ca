"""Segment Anything by torch on a tiny model with random weights, and the way to ONNX and back."""

from __future__ import annotations

import importlib.util
import sys
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from pscover.errors import InvalidImage, InvalidSettings, Refused
from pscover.perception import torchvision_stand_in
from pscover.perception.guided import Guide, segment_guided
from pscover.perception.models import SUMS, vouch
from pscover.perception.onnx_sam import OnnxSam
from pscover.perception.segmenters.sam import Sam
from pscover.perception.torch_sam import TorchSam, usable

torch = pytest.importorskip("torch")
pytest.importorskip("cv2")
if importlib.util.find_spec("segment_anything") is None:
    pytest.skip("needs segment-anything", allow_module_level=True)

SIDE, PATCH, WIDTH = 128, 16, 32


def tiny() -> Any:
    """A model of SAM's structure, a thousandth of its size, with random weights."""
    torchvision_stand_in.segment_anything()
    from segment_anything.modeling import ImageEncoderViT, MaskDecoder, PromptEncoder, TwoWayTransformer
    from segment_anything.modeling import Sam as Structure

    torch.manual_seed(0)
    cells = SIDE // PATCH
    return Structure(
        image_encoder=ImageEncoderViT(
            depth=2, embed_dim=16, img_size=SIDE, mlp_ratio=2, norm_layer=partial(torch.nn.LayerNorm, eps=1e-6),
            num_heads=2, patch_size=PATCH, use_rel_pos=True, global_attn_indexes=(1,), window_size=3, out_chans=WIDTH,
        ),
        prompt_encoder=PromptEncoder(
            embed_dim=WIDTH, image_embedding_size=(cells, cells), input_image_size=(SIDE, SIDE), mask_in_chans=4
        ),
        mask_decoder=MaskDecoder(
            num_multimask_outputs=3,
            transformer=TwoWayTransformer(depth=1, embedding_dim=WIDTH, mlp_dim=32, num_heads=8),
            transformer_dim=WIDTH, iou_head_depth=2, iou_head_hidden_dim=16,
        ),
        pixel_mean=[123.675, 116.28, 103.53], pixel_std=[58.395, 57.12, 57.375],
    ).eval()  # fmt: skip


@pytest.fixture(scope="module")
def checkpoint(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("weights") / "tiny.pth"
    torch.save(tiny().state_dict(), path)
    (path.parent / SUMS).write_bytes(vouch(path))
    return path


@pytest.fixture
def photo() -> NDArray[np.uint8]:
    return np.random.default_rng(0).integers(0, 256, (60, 90, 3)).astype(np.uint8)


@pytest.fixture
def without_segment_anything(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    for name in [name for name in sys.modules if name.split(".")[0] in ("segment_anything", "torchvision")]:
        monkeypatch.delitem(sys.modules, name)
    yield
    for name in [name for name in sys.modules if name.split(".")[0] in ("segment_anything", "torchvision")]:
        del sys.modules[name]


def test_the_structure_is_read_off_the_weights(checkpoint: Path, photo: NDArray[np.uint8]) -> None:
    square = torch.rand(1, 3, SIDE, SIDE)
    loaded = TorchSam.load(checkpoint, "cpu").model
    with torch.inference_mode():
        assert torch.equal(loaded.image_encoder(square), tiny().image_encoder(square))
    assert TorchSam.load(checkpoint, "cpu").model is loaded, "a model is loaded once"


def test_prompting_is_the_predictor_s(checkpoint: Path, photo: NDArray[np.uint8]) -> None:
    package = torchvision_stand_in.segment_anything()
    model = TorchSam.load(checkpoint, "cpu")
    predictor = package.SamPredictor(model.model)
    predictor.set_image(photo)
    points = np.array([[30.0, 20.0], [70.5, 41.25]])
    decoded = model.embed(photo).decode(points)
    for k, point in enumerate(points):
        _, iou, low = predictor.predict(point_coords=point[None], point_labels=np.ones(1))
        rows, columns = decoded.logits.shape[2:]
        # The two scale the photo by different code: Pillow's and OpenCV's.
        assert np.abs(decoded.logits[k] - low[:, :rows, :columns]).max() < 0.02 * np.ptp(low)
        assert np.allclose(decoded.iou[k], iou, atol=1e-2)


@pytest.mark.parametrize("mode", ["guided", "amg"])
def test_both_modes_run(checkpoint: Path, photo: NDArray[np.uint8], mode: Any) -> None:
    before = torch.get_num_threads()
    segmenter = Sam(checkpoint=str(checkpoint), mode=mode, prompts=8, points_per_side=3, min_iou=0.0, min_stability=0.0)
    found = segmenter.segment(photo, np.ones((60, 90), dtype=np.bool_))
    assert found.stages[0].name == ("generator" if mode == "amg" else "encoder")
    assert all(mask.pixels((60, 90)).any() for mask in found.masks)
    assert torch.get_num_threads() == before
    if mode == "amg":
        assert found.masks


def test_an_unknown_checkpoint_is_refused_before_it_is_read(tmp_path: Path, photo: NDArray[np.uint8]) -> None:
    path = tmp_path / "sam.pth"
    path.write_bytes(b"not to be unpickled")
    with pytest.raises(InvalidSettings, match="expected SHA-256"):
        Sam(checkpoint=str(path)).segment(photo, np.ones((60, 90), dtype=np.bool_))


@pytest.mark.parametrize("content", ["garbage", "tensors", "code"])
def test_a_checkpoint_that_is_none_is_our_error(tmp_path: Path, content: str) -> None:
    path = tmp_path / "sam.pth"
    if content == "garbage":
        path.write_bytes(b"\x80\x04garbage")
    else:
        torch.save({"weight": torch.zeros(3)} if content == "tensors" else {"weight": Path}, path)
    with pytest.raises(InvalidImage, match=r"sam\.pth: expected"):
        TorchSam.load(path, "cpu")


def test_devices() -> None:
    assert usable("cpu") == "cpu"
    assert usable("auto") == ("cuda" if torch.cuda.is_available() else "cpu")
    for wrong in ("gpu", "cuda:x", "cpu:1", ""):
        with pytest.raises(InvalidSettings, match="device: expected"):
            usable(wrong)
    with pytest.raises(Refused, match="use device=cpu"):
        usable("cuda:99")


@pytest.mark.skipif(torch.cuda.is_available(), reason="there is a CUDA device")
def test_without_cuda_a_request_for_it_is_refused_with_the_reason(checkpoint: Path, photo: NDArray[np.uint8]) -> None:
    with pytest.raises(
        Refused, match=r"device 'cuda': (this build of torch is for the CPU alone|torch sees 0 CUDA devices)"
    ):
        Sam(checkpoint=str(checkpoint), device="cuda").segment(photo, np.ones((60, 90), dtype=np.bool_))


@pytest.mark.skipif(not torch.cuda.is_available(), reason="needs a CUDA device")
def test_cuda_and_cpu_agree(checkpoint: Path, photo: NDArray[np.uint8]) -> None:
    points = np.array([[30.0, 20.0]])
    cpu, cuda = (TorchSam.load(checkpoint, device).embed(photo).decode(points) for device in ("cpu", "cuda"))
    assert np.allclose(cpu.logits, cuda.logits, atol=1e-2)


def test_a_device_that_is_there_is_taken(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(torch.cuda, "is_available", lambda: True)
    monkeypatch.setattr(torch.cuda, "device_count", lambda: 2)
    assert [usable(name) for name in ("auto", "cuda", "cuda:1", "cpu")] == ["cuda", "cuda", "cuda:1", "cpu"]
    monkeypatch.setattr(torch.version, "cuda", "13.0")
    with pytest.raises(Refused, match=r"device 'cuda:2': torch sees 2 CUDA devices"):
        usable("cuda:2")


class Elsewhere:
    """A model on a device that only has shapes: it notes where what it is given lies and in which precision."""

    device = torch.device("meta")

    def __init__(self) -> None:
        self.given: list[Any] = []

    @property
    def image_encoder(self) -> Any:
        return self

    prompt_encoder = image_encoder
    img_size = SIDE

    def __call__(self, *tensors: Any, points: Any = (), boxes: None = None, masks: None = None) -> Any:
        self.given += [*tensors, *points]
        return self.given[0] if tensors else (points[0], points[0])

    def get_dense_pe(self) -> Any:
        return torch.zeros(1, device=self.device)

    def mask_decoder(self, *, multimask_output: bool, **tensors: Any) -> tuple[Any, Any]:
        self.given += tensors.values()
        assert multimask_output
        count = len(tensors["sparse_prompt_embeddings"])
        return torch.ones(count, 3, SIDE // 4, SIDE // 4), torch.ones(count, 3)


def test_all_that_the_model_is_given_is_on_its_device(photo: NDArray[np.uint8]) -> None:
    model = Elsewhere()
    decoded = TorchSam(model=model).embed(photo).decode(np.array([[30.0, 20.0], [5.0, 5.0]]))
    assert decoded.logits.shape[:2] == (2, 3)
    assert len(model.given) == 7
    assert {tensor.device.type for tensor in model.given} == {"meta"}
    assert {tensor.dtype for tensor in model.given} == {torch.float32, torch.int32}


def test_the_stand_in_for_nms_brings_groups_to_the_boxes_device() -> None:
    class OnTheCpu:
        moved: Any = None

        def to(self, device: Any) -> Any:
            self.moved = device
            return torch.zeros(2)

    groups, boxes = OnTheCpu(), torch.tensor([[0.0, 0.0, 4.0, 4.0], [0.0, 0.0, 4.0, 3.9]])
    kept = torchvision_stand_in.batched_nms(boxes, torch.tensor([0.5, 0.9]), groups, 0.7)
    assert kept.tolist() == [1]
    assert groups.moved == boxes.device


def test_a_broken_torchvision_is_stood_in_for_and_leaves_no_trace(
    without_segment_anything: None, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    package = tmp_path / "torchvision"
    (package / "transforms").mkdir(parents=True)
    (package / "extra.py").write_text("")
    (package / "__init__.py").write_text(
        "from . import extra\nraise RuntimeError('operator torchvision::nms does not exist')\n"
    )
    monkeypatch.syspath_prepend(tmp_path)
    assert not torchvision_stand_in.torchvision_works()
    module = torchvision_stand_in.segment_anything()
    assert sys.modules["segment_anything.automatic_mask_generator"].batched_nms is torchvision_stand_in.batched_nms
    assert hasattr(module, "SamAutomaticMaskGenerator")
    assert not [name for name in sys.modules if name.split(".")[0] == "torchvision"]


def test_a_torchvision_that_works_is_used(
    without_segment_anything: None, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    for folder, line in (
        ("ops/boxes.py", "batched_nms = box_area = 1"),
        ("transforms/functional.py", "resize = to_pil_image = 1"),
    ):
        path = tmp_path / "torchvision" / folder
        path.parent.mkdir(parents=True)
        path.write_text(line)
        (path.parent / "__init__.py").write_text("")
    (tmp_path / "torchvision" / "__init__.py").write_text("")
    monkeypatch.syspath_prepend(tmp_path)
    assert torchvision_stand_in.torchvision_works()
    torchvision_stand_in.segment_anything()
    assert sys.modules["segment_anything.automatic_mask_generator"].batched_nms == 1


def test_suppression_of_boxes() -> None:
    boxes = torch.tensor([[0, 0, 10, 10], [1, 1, 10, 10], [0, 0, 10, 10], [20, 20, 30, 30]])
    scores, groups = torch.tensor([0.8, 0.9, 0.7, 0.1]), torch.tensor([0, 0, 1, 0])
    assert torchvision_stand_in.batched_nms(boxes, scores, groups, 0.5).tolist() == [1, 2, 3]
    assert torchvision_stand_in.batched_nms(boxes[:0], scores[:0], groups[:0], 0.5).tolist() == []


def test_export_to_onnx_gives_the_same_masks(checkpoint: Path, photo: NDArray[np.uint8], tmp_path: Path) -> None:
    pytest.importorskip("onnx")
    pytest.importorskip("onnxruntime")
    from pscover.perception.export import export
    from pscover.perception.models import DECODER, ENCODER, locate

    (tmp_path / SUMS).write_text("00  other.onnx\n11  mobile_sam_encoder.onnx\n")
    written = export(checkpoint, tmp_path)
    assert written.difference < 1e-3
    lines = (tmp_path / SUMS).read_text().splitlines()
    assert [line.split()[1] for line in lines] == ["other.onnx", "mobile_sam_encoder.onnx", "mobile_sam_decoder.onnx"]
    assert locate(ENCODER, str(written.encoder)) == written.encoder
    assert locate(DECODER, str(written.decoder)) == written.decoder
    cloth, guide = np.ones((60, 90), dtype=np.bool_), Guide(prompts=6, min_iou=0.0, min_stability=0.0)
    ours = OnnxSam.load(written.encoder, written.decoder, threads=1)
    one, two = (segment_guided(model, photo, cloth, guide).masks for model in (ours, TorchSam.load(checkpoint, "cpu")))
    assert [(mask.top, mask.left, mask.area) for mask in one] == [(mask.top, mask.left, mask.area) for mask in two]


def tiny_vit_state(width: int = 6) -> dict[str, Any]:
    """Random weights of a small TinyViT: one block a stage, widths 8 to 12, windows of 3 x 3."""
    state: dict[str, Any] = {}

    def convolution(name: str, outside: int, inside: int, kernel: int) -> None:
        state[f"{name}.c.weight"] = torch.randn(outside, inside, kernel, kernel) / kernel
        for part, value in (("weight", 1.0), ("bias", 0.1), ("running_mean", 0.2), ("running_var", 1.5)):
            state[f"{name}.bn.{part}"] = torch.full((outside,), value)

    def plain(name: str, *shape: int) -> None:
        state[f"{name}.weight"] = torch.randn(*shape) / shape[-1] if len(shape) > 1 else torch.rand(*shape)
        state[f"{name}.bias"] = torch.zeros(shape[0])

    torch.manual_seed(0)
    convolution("patch_embed.seq.0", 4, 3, 3)
    convolution("patch_embed.seq.2", 8, 4, 3)
    for number, shape in (("1", (16, 8, 1)), ("2", (16, 1, 3)), ("3", (8, 16, 1))):
        convolution(f"layers.0.blocks.0.conv{number}", *shape)
    for stage, wide in ((1, 8), (2, 8), (3, 12)):
        block, before = f"layers.{stage}.blocks.0", f"layers.{stage - 1}.downsample"
        convolution(f"{before}.conv1", wide, 8, 1)
        convolution(f"{before}.conv2", wide, 1, 3)
        convolution(f"{before}.conv3", wide, wide, 1)
        state[f"{block}.attn.attention_biases"] = torch.randn(2, 9)
        convolution(f"{block}.local_conv", wide, 1, 3)
        for name, sizes in (
            ("attn.norm", (wide,)), ("attn.qkv", (3 * wide, wide)), ("attn.proj", (wide, wide)),
            ("mlp.norm", (wide,)), ("mlp.fc1", (16, wide)), ("mlp.fc2", (wide, 16)),
        ):  # fmt: skip
            plain(f"{block}.{name}", *sizes)
    plain("neck.0", width, 12, 1, 1)
    plain("neck.1", width)
    plain("neck.2", width, width, 3, 3)
    plain("neck.3", width)
    return state


def test_the_encoder_of_mobile_sam_survives_the_way_to_onnx() -> None:
    pytest.importorskip("onnx")
    onnxruntime = pytest.importorskip("onnxruntime")
    from pscover.perception.export import _traced
    from pscover.perception.tiny_vit import tiny_vit

    encoder, photo = tiny_vit(tiny_vit_state(), img_size=64), torch.rand(1, 3, 64, 64)
    content = _traced(encoder, (torch.rand(1, 3, 64, 64),), ["x"], ["emb"], {})
    (got,) = onnxruntime.InferenceSession(content).run(None, {"x": photo.numpy()})
    with torch.inference_mode():
        expected = encoder(photo).numpy()
    assert got.shape == (1, 6, 4, 4)
    assert np.abs(got - expected).max() < 1e-4


def whole_mobile_sam() -> dict[str, Any]:
    """A checkpoint of a small MobileSAM: TinyViT, and SAM's own prompt encoder and mask decoder."""
    package = torchvision_stand_in.segment_anything()
    from segment_anything.modeling import MaskDecoder, PromptEncoder, TwoWayTransformer

    assert package
    decoder = MaskDecoder(
        transformer_dim=16, transformer=TwoWayTransformer(depth=1, embedding_dim=16, num_heads=8, mlp_dim=16),
        num_multimask_outputs=3, iou_head_depth=2, iou_head_hidden_dim=8,
    )  # fmt: skip
    prompts = PromptEncoder(embed_dim=16, image_embedding_size=(64, 64), input_image_size=(1024, 1024), mask_in_chans=4)
    return {
        **{f"image_encoder.{name}": value for name, value in tiny_vit_state(width=16).items()},
        **{f"prompt_encoder.{name}": value for name, value in prompts.state_dict().items()},
        **{f"mask_decoder.{name}": value for name, value in decoder.state_dict().items()},
    }


@pytest.mark.parametrize(
    "lost",
    [
        "image_encoder.layers.2.blocks.0.attn.qkv.weight", "image_encoder.neck.2.weight", "image_encoder.layers.1.",
        "image_encoder.layers.0.downsample.conv2.bn.running_var", "mask_decoder.iou_token.weight", "prompt_encoder.",
    ],
)  # fmt: skip
def test_a_checkpoint_that_lacks_weights_is_refused_when_it_is_loaded(tmp_path: Path, lost: str) -> None:
    whole = whole_mobile_sam()
    torch.save(whole, tmp_path / "whole.pt")
    assert TorchSam.load(tmp_path / "whole.pt", "cpu").model.image_encoder.img_size == 1024
    torch.save({name: value for name, value in whole.items() if not name.startswith(lost)}, tmp_path / "part.pt")
    with pytest.raises(InvalidImage, match=r"part\.pt: expected the weights of SAM .* or MobileSAM, got others \(.{9,}\)"):
        TorchSam.load(tmp_path / "part.pt", "cpu")
    narrow = {f"image_encoder.{name}": value for name, value in tiny_vit_state(width=8).items()}
    torch.save({**whole, **narrow}, tmp_path / "mixed.pt")
    with pytest.raises(InvalidImage, match="decoder takes 16 channels, the encoder gives 8"):
        TorchSam.load(tmp_path / "mixed.pt", "cpu")


def test_files_that_are_no_models_are_our_errors(tmp_path: Path) -> None:
    pytest.importorskip("onnxruntime")
    path = tmp_path / "model.onnx"
    path.write_bytes(b"no model")
    with pytest.raises(InvalidImage, match=r"model\.onnx: expected an ONNX model"):
        OnnxSam.load(path, path, threads=1)
