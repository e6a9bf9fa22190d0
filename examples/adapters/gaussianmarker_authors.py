"""Call GaussianMarker's program and decoder in the current folder: embed, or detect (gaussianmarker_authors.toml)."""

import json
import random
import shutil
import subprocess
import sys
from pathlib import Path

STEPS = "2000"  # of its README


def embed(scene, model, out, seed):
    """Mark a model of the scene with 48 random bits, which its decoder can read."""
    bits = f"{random.Random(seed).getrandbits(48):048b}"  # noqa: S311
    words = ["-s", scene, "-m", model, "--iterations", STEPS, "--save_iterations", STEPS, "--input_msg", bits]
    subprocess.run([sys.executable, "train_gaussianmarker.py", *words], check=True)
    marked = Path(model, "point_cloud_uncertainty_wm", f"iteration_{STEPS}", "point_cloud_wm.ply")
    shutil.copy(marked, Path(out, "public", "point_cloud.ply"))
    Path(out, "key", "message.txt").write_text(bits)


def detect(_, images):
    """Print the bits of every image."""
    sys.path.insert(0, "")
    import torch
    from hidden.hidden_images import decoder, default_transform, device, msg2str
    from PIL import Image

    bits = {}
    for file in Path(images).glob("*.png"):
        with torch.no_grad():
            logits = decoder(default_transform(Image.open(file).convert("RGB"))[None].to(device))
        bits[file.stem] = msg2str((logits[0] > 0).tolist())
    print(json.dumps(bits))


{"embed": embed, "detect": detect}[sys.argv[1]](*sys.argv[2:])
