"""Measure how robust a 3D Gaussian Splatting watermark is.

The names below are the public interface; each is imported when it is first used, so that ``import gspure`` is quick.

>>> import gspure
>>> model = gspure.read_model("point_cloud.ply")  # doctest: +SKIP
>>> cameras = gspure.read_cameras("cameras.json")  # doctest: +SKIP
>>> purified = gspure.purify(model, cameras).model  # doctest: +SKIP
>>> gspure.write_model("purified.ply", purified)  # doctest: +SKIP

Models
    `read_model`, `write_model`: a `gspure.model.Gaussians` and its 3DGS PLY.
Cameras
    `read_cameras`, `write_cameras`: a list of `gspure.cameras.Camera` and its file; `orbit_cameras`: views around a
    model that came without.
Rendering
    `Renderer`: images, feature maps, their gradients, contributions, depth and transmittance of a model's views.
The method
    `purify`: GSPure on one model.
Metrics
    `psnr`, `ssim`: of two images [H,W,3] in 0..1, as 3DGS defines them.
Errors
    `InputError`: the `ValueError` of bad input, one line that names file and field.
"""

__version__ = "0.1.0"

__all__ = [
    "InputError",
    "Renderer",
    "__version__",
    "orbit_cameras",
    "psnr",
    "purify",
    "read_cameras",
    "read_model",
    "ssim",
    "write_cameras",
    "write_model",
]

TYPE_CHECKING = False  # not imported: an interruption before `gspure.__main__` would print a traceback
if TYPE_CHECKING:
    from gspure.cameras import orbit_cameras, read_cameras, write_cameras
    from gspure.errors import InputError
    from gspure.evaluation.metrics import psnr, ssim
    from gspure.method.purify import purify
    from gspure.model import read_model, write_model
    from gspure.renderer import Renderer
else:
    _HOMES = {
        "InputError": "gspure.errors",
        "Renderer": "gspure.renderer",
        "orbit_cameras": "gspure.cameras",
        "psnr": "gspure.evaluation.metrics",
        "purify": "gspure.method.purify",
        "read_cameras": "gspure.cameras",
        "read_model": "gspure.model",
        "ssim": "gspure.evaluation.metrics",
        "write_cameras": "gspure.cameras",
        "write_model": "gspure.model",
    }

    def __getattr__(name):
        if name not in _HOMES:
            raise AttributeError(f"module 'gspure' has no attribute {name!r}")
        from importlib import import_module

        globals()[name] = value = getattr(import_module(_HOMES[name]), name)
        return value

    def __dir__():
        return sorted({*globals(), *__all__})
