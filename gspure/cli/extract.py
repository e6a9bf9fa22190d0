"""``gspure extract``: render the message with the owner's key."""

import numpy as np

from gspure.cameras.camera import Camera
from gspure.cameras.photographs import photograph, photograph_size
from gspure.cameras.reading import read_transform
from gspure.cameras.worlds import mention_near
from gspure.cli import options
from gspure.cli.parser import Arguments, Parser
from gspure.errors import InputError
from gspure.files import filling_alone
from gspure.images import is_blank, write_image
from gspure.metrics.targets import ADAPTIVE
from gspure.model import model_file
from gspure.progress import track, warn
from gspure.provenance import run_of
from gspure.public_model import Lesson
from gspure.schemes.matching import registered
from gspure.schemes.pair import Capture, message_folder
from gspure.schemes.readability import readability
from gspure.schemes.registry import find_scheme, made_by
from gspure.schemes.scheme import FIT_STEPS

EXAMPLES = """\
  gspure extract marked/public --key marked/key --out message          # in the views of the key's pair
  gspure extract moved.ply --key marked/key --cameras pair/message --out message \\
      --extraction message_adaptive --original marked/public             # an unknown rotation or scale
  gspure extract marked/public --key marked/key --out wrong_key --wrong-key 1      # a negative control
"""


def add_arguments(parser: Parser) -> None:
    parser.reads("model", "MODEL", "the model's file, or its folder")
    parser.text("--scheme", "NAME", "the watermarking scheme (default: that of the key)")
    parser.reads("--key", "DIR", "the owner's key, from `gspure embed`")
    meaning = "message (as published; the default), message_adaptive (adapted to the attack), or another of the scheme"
    parser.text("--extraction", "NAME", meaning)
    options.add_control_keys(parser)
    meaning = "photographs of the message, to judge it and to adapt to (default: to judge it, those of the key's pair)"
    parser.reads("--photographs", "DIR", meaning, required=False)
    meaning = "the published model; first undo an unknown rotation, translation and scale of MODEL"
    parser.reads("--original", "MODEL", meaning, required=False)
    options.add_views(parser, "all", more=" (default: the message's in the key's pair)", required=False)
    parser.writes("--out", "DIR", "folder for VIEW.png")
    options.add_device(parser)


def run(args: Arguments) -> None:
    """Extract every view."""
    scheme_name = options.key_scheme(args)
    source = args.cameras or message_folder(made_by(args.key)[1])
    scheme = find_scheme(scheme_name)
    views = options.read_views(args, args.split, args.transform, source)
    public = scheme.read_public(args.model).drawn(args.model)
    key = options.read_key(args, run_of(model_file(args.model)))
    extraction = args.extraction or next(iter(scheme.extractions))
    if extraction not in scheme.extractions:
        expected = f"one of {', '.join(scheme.extractions)}"
        raise InputError(f"scheme {scheme.name}", "--extraction", expected=expected, found=repr(extraction))
    if args.original and args.transform:
        raise InputError("extract", "--transform", expected="nothing beside --original", found=str(args.transform))
    if args.original:
        original = scheme.read_public(args.original).drawn(args.original)
        public = registered(public, original.model)
    if scheme.fits and extraction == ADAPTIVE:
        key = key.fitted(public, _lesson(args))
    mention_near(public.model.means.astype(np.float64), views)
    images = key.images(public, extraction, views, options.read_device(args))
    all_blank = True
    with filling_alone(args.out) as folder:
        for camera, image in zip(track(views, "extract"), images, strict=True):
            write_image(folder / f"{camera.name}.png", image)
            all_blank &= is_blank(image)
        if isinstance(source, str):
            options.write_views(folder, views)
        resolved = {"scheme": scheme_name, "cameras": source, "extraction": extraction}
        options.record_command(args, folder, resolved=resolved)
    if args.wrong_key is not None:
        return
    capture = None if args.transform else _message_photographs(args)
    if capture:
        readability(capture, public, key, options.read_device(args)).report()
    if all_blank:
        may_adapt = ADAPTIVE in scheme.extractions and extraction != ADAPTIVE
        _warn_of_blank_images(has_original=bool(args.original), may_adapt=may_adapt)


def _message_photographs(args: Arguments) -> Capture | None:
    """Return the photographs of the message, by which it is judged: those of ``--photographs`` or of the key's pair.

    Return None without any, or if they have not the shape of their views.
    """
    if args.photographs:
        return Capture.read(args.photographs)
    try:
        capture = Capture.read(message_folder(made_by(args.key)[1]))
    except InputError:  # the pair is elsewhere, or its photographs are
        return None
    return capture if all(map(_has_shape_of_photograph, capture.views)) else None


def _has_shape_of_photograph(view: Camera) -> bool:
    """Return whether a view is its photograph, perhaps reduced and rounded to whole pixels."""
    width, height = photograph_size(photograph(view))
    return abs(width * view.height - height * view.width) <= width + height


def _warn_of_blank_images(*, has_original: bool, may_adapt: bool) -> None:
    causes = "the key does not match the model, Gaussians were moved or rounded, or an attack removed the message"
    options_to_try = []
    if not has_original:
        options_to_try.append("--original")
    if may_adapt:
        options_to_try.append(f"--extraction {ADAPTIVE}")
    advice = f" (for moved or rounded Gaussians, try {' or '.join(options_to_try)})" if options_to_try else ""
    warn(f"all extracted images are blank: {causes}{advice}")


def _lesson(args: Arguments) -> Lesson:
    """Return the lesson of the key: photographs of the message, in training views that move with the model."""
    if not args.photographs:
        raise InputError("extract", "--photographs", expected="photographs of the message to learn from", found="none")
    capture = Capture.read(args.photographs)
    transform = read_transform(args.transform) if args.transform else np.eye(4)
    views = [camera.moved(transform) for camera in capture.views]
    return Lesson(views, capture.images, (), FIT_STEPS, np.random.default_rng(0), device=options.read_device(args))
