"""``gspure extract``: render the message with the owner's key."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from gspure.cli.parser import Arguments, Parser

if TYPE_CHECKING:
    from pathlib import Path

    from gspure.public_model import Lesson

EXAMPLES = """\
  gspure extract marked/public --scheme gs_hider --key marked/key --cameras pair/message --out message
  gspure extract purified.ply --scheme splats_in_splats --key marked/key --cameras pair/message --out message \\
      --extraction message_oracle                                                    # with the exact hidden values
  gspure extract moved.ply --scheme splats_in_splats --key marked/key --cameras pair/message --out message \\
      --extraction message_adaptive --original marked/public                         # an unknown rotation or scale
  gspure extract marked/public --scheme gs_hider --key marked/key --cameras pair/message --out wrong_key \\
      --wrong-key 1                                                                  # a negative control
"""

FIT_STEPS: Final = 300
"""Training steps of a decoder, or of private networks, on an attacked model. Ours."""


def add_arguments(parser: Parser) -> None:
    from gspure.cli.options import add_control_keys, add_device, add_off_path, add_views

    parser.reads("model", "MODEL", "the model's file, or its folder")
    parser.text("--scheme", "NAME", "the watermarking scheme", required=True)
    parser.reads("--key", "DIR", "the owner's key, from `gspure embed`")
    parser.text("--extraction", "NAME", "an extraction of the scheme (default: `message`)")
    add_control_keys(parser)
    parser.reads(
        "--photographs",
        "DIR",
        "photographs and cameras of the message (PAIR/message), for `message_adaptive` of gs_hider, secure_gs and "
        "keyss; only the training views are used",
        required=False,
    )
    parser.reads(
        "--original",
        "MODEL",
        "the published model; with it, an unknown rotation, translation and scale of the attacked model is undone "
        "first",
        required=False,
    )
    add_views(parser, split="all")
    add_off_path(parser)
    parser.writes("--out", "DIR", "folder for VIEW.png; it must not hold other images")
    add_device(parser)


def run(args: Arguments) -> None:
    """Extract every view."""
    from gspure.artifacts import RENDERED, embedding_of, facts_of, filling, known_digest
    from gspure.cli.options import read_device, read_key, read_views, unmoved, write_views
    from gspure.errors import InputError
    from gspure.evaluation.controls import WRONG_KEY
    from gspure.evaluation.origins import attacks_of
    from gspure.images import is_blank, record_views, require_no_other_images, write_image
    from gspure.model import model_file
    from gspure.progress import track, warn
    from gspure.schemes.matching import registered
    from gspure.schemes.registry import find_scheme, read_of
    from gspure.schemes.scheme import ADAPTIVE, MESSAGE

    scheme = find_scheme(args.scheme)
    views = read_views(args)
    require_no_other_images(args.out, (camera.name for camera in views))
    public = read_of(scheme, args.model).drawn(args.model)
    key = read_key(args, embedding_of(model_file(args.model)))
    extraction = args.extraction or next(iter(scheme.extractions))
    if extraction not in scheme.extractions:
        expected = f"one of {', '.join(scheme.extractions)}"
        raise InputError(f"scheme {scheme.name}", "--extraction", expected=expected, found=repr(extraction))
    if args.original and args.transform:
        raise InputError("extract", "--transform", expected="nothing beside --original", found=str(args.transform))
    if args.original:
        _require_published(model_file(args.original), embedding_of(args.key))
        public = registered(public, read_of(scheme, args.original).drawn(args.original).model)
    if scheme.fits and extraction == ADAPTIVE:
        key = key.fitted(public, _lesson(args))
    view, all_blank = key.message(public, extraction, read_device(args)), True
    names = [RENDERED, *(f"{camera.name}.png" for camera in views)]
    with filling(args.out, *names, *["cameras.json"] * isinstance(args.cameras, str)) as folder:
        for camera in track(views, "extract"):
            image = view(camera)
            write_image(folder / f"{camera.name}.png", image)
            all_blank &= is_blank(image)
        model, attack = known_digest(model_file(args.model)), attacks_of(model_file(args.model))
        owner = WRONG_KEY if args.wrong_key is not None else embedding_of(args.key)
        shown, photographs = unmoved(args, views), facts_of(args.key).get(MESSAGE, "")
        origin = {"target": extraction, "model": model, "attack": attack, "key": owner, "photographs": photographs}
        record_views(folder, shown, (), "", **origin)
        if isinstance(args.cameras, str):
            write_views(args, folder, views)
    if all_blank and args.wrong_key is None:
        causes = "the key does not match the model, Gaussians were moved or rounded, or an attack removed the message"
        options = ["--original"] * (not args.original)
        options += [f"--extraction {ADAPTIVE}"] * (ADAPTIVE in scheme.extractions and extraction != ADAPTIVE)
        advice = f" (for moved or rounded Gaussians, try {' or '.join(options)})" if options else ""
        warn(f"all extracted images are blank: {causes}{advice}")


def _require_published(file: Path, embedding: str) -> None:
    """Refuse a model that is not the published one of an embedding, or was changed since."""
    from gspure.artifacts import known_digest
    from gspure.errors import InputError

    if embedding and known_digest(file) != embedding:
        raise InputError(
            file, "--original", expected="the published model of the key", found="an attacked or another one"
        )


def _lesson(args: Arguments) -> Lesson:
    """Return what the key learns from: photographs of the message, in training views that move with the model."""
    import numpy as np

    from gspure.cameras.photographs import photograph
    from gspure.cameras.reading import read_transform
    from gspure.cli.options import read_device
    from gspure.errors import InputError
    from gspure.images import require_photographs
    from gspure.public_model import Lesson
    from gspure.schemes.pair import Capture
    from gspure.schemes.scheme import MESSAGE

    if not args.photographs:
        raise InputError("extract", "--photographs", expected="photographs of the message to learn from", found="none")
    capture = Capture.read(args.photographs)
    require_photographs(photograph(capture.views[0]).parent, MESSAGE, {})
    transform = read_transform(args.transform) if args.transform else np.eye(4)
    views = [camera.moved(transform) for camera in capture.views]
    return Lesson(views, capture.images, (), FIT_STEPS, np.random.default_rng(0), device=read_device(args))
