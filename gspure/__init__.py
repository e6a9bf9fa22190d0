"""Measure how robust a 3D Gaussian Splatting watermark is.

The names below are the public interface; each is imported when it is first used, so that ``import gspure`` is quick.

>>> import gspure
>>> from gspure.cameras import split
>>> model = gspure.read_model("point_cloud.ply")  # doctest: +SKIP
>>> train, test = split(gspure.read_cameras("cameras.json"))  # doctest: +SKIP
>>> purified = gspure.purify(model, train).model  # doctest: +SKIP
>>> gspure.write_model("purified.ply", purified)  # doctest: +SKIP

Models
    `read_model`, `write_model`: `Gaussians`, whose rows are ``model[:10]`` or ``model[mask]``, and their file;
    ``Gaussians.from_gsplat`` takes the tensors of gsplat.
Cameras
    `read_cameras`, `write_cameras`: a list of `gspure.cameras.Camera` and its file; `orbit_cameras`: views around a
    model without cameras.
Rendering
    `Renderer`: images, feature maps, their gradients, contributions, depth and transmittance of a model's views.
    `view`, also ``model.view()``: the `View` of a model in 3-D, which a cell of a notebook shows.
The method
    `purify`: GSPure on one model.
Audits
    `audit`: ``gspure audit``, which returns an `Audit`: results and robust radii.
Attacks and schemes
    `find_attack`: an attack by name; its ``apply(model)`` returns the attacked model and, for each of its rows, the
    row that it comes from.
    `find_scheme`: a watermarking scheme by name, which reads the owner's key; the key's ``message(...)`` renders the
    message. `Pair`: photographs of a scene and a message. `hide`: trains a scheme on a pair. `read_public_model`: a
    model with the files beside it. `Plugin`: what a package adds.
Metrics
    `psnr`, `ssim`: of two images [H,W,3] in 0..1, as 3DGS defines them.
Errors
    `InputError`: the `ValueError` of bad input, one line that names file and field.
"""

__version__ = "0.2.0"

TYPE_CHECKING = False  # not imported: an interruption before `gspure.__main__` would print a traceback
if TYPE_CHECKING:
    from gspure.attacks import find_attack as find_attack
    from gspure.cameras import orbit_cameras as orbit_cameras
    from gspure.cameras import read_cameras as read_cameras
    from gspure.cameras import write_cameras as write_cameras
    from gspure.errors import InputError as InputError
    from gspure.method.purify import purify as purify
    from gspure.metrics.image_metrics import psnr as psnr
    from gspure.metrics.image_metrics import ssim as ssim
    from gspure.model import Gaussians as Gaussians
    from gspure.model import read_model as read_model
    from gspure.model import write_model as write_model
    from gspure.plugins import Plugin as Plugin
    from gspure.renderer import Renderer as Renderer
    from gspure.schemes.pair import Pair as Pair
    from gspure.schemes.registry import find_scheme as find_scheme
    from gspure.schemes.registry import read_public_model as read_public_model
    from gspure.schemes.scheme import hide as hide
    from gspure.viewer.view import View as View
    from gspure.viewer.view import view as view
    from gspure.workflow.auditing import Audit as Audit
    from gspure.workflow.auditing import audit as audit
else:
    _HOMES = {
        "Audit": "gspure.workflow.auditing",
        "Gaussians": "gspure.model",
        "InputError": "gspure.errors",
        "Pair": "gspure.schemes.pair",
        "Plugin": "gspure.plugins",
        "Renderer": "gspure.renderer",
        "View": "gspure.viewer.view",
        "audit": "gspure.workflow.auditing",
        "find_attack": "gspure.attacks",
        "find_scheme": "gspure.schemes.registry",
        "hide": "gspure.schemes.scheme",
        "orbit_cameras": "gspure.cameras",
        "psnr": "gspure.metrics.image_metrics",
        "purify": "gspure.method.purify",
        "read_cameras": "gspure.cameras",
        "read_model": "gspure.model",
        "read_public_model": "gspure.schemes.registry",
        "ssim": "gspure.metrics.image_metrics",
        "view": "gspure.viewer.view",
        "write_cameras": "gspure.cameras",
        "write_model": "gspure.model",
    }
    __all__ = list(_HOMES)

    def __getattr__(name):
        if name not in _HOMES:
            raise AttributeError(f"module 'gspure' has no attribute {name!r}")
        from importlib import import_module

        value = getattr(import_module(_HOMES[name]), name)
        globals()[name] = value
        return value

    def __dir__():
        return sorted({*globals(), *__all__})
