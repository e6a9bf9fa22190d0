"""gspure: how robust is a 3D Gaussian Splatting watermark?

The package measures it with GSPure (view-accumulated contribution weights, HDBSCAN on position, opacity and weight,
adaptive pruning) and with simpler attacks, on any OpenCL device.

>>> import gspure
>>> model = gspure.read_model("point_cloud.ply")  # doctest: +SKIP
>>> cameras = gspure.read_cameras("cameras.json")  # doctest: +SKIP
>>> purified = gspure.purify(model, cameras).model  # doctest: +SKIP
"""

__version__ = "0.1.0"
