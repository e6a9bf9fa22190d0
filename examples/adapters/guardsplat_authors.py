"""Call GuardSplat's program and its decoder in the current folder: embed, or detect (guardsplat_authors.toml)."""

import json
import shutil
import subprocess
import sys
from pathlib import Path

DECODER = "CLIP-MsgDecoder-32.pkl"


def embed(scene, model, iterations, out):
    """Mark a model of the scene: add the offsets of harmonics that it saves to the stored ones."""
    import torch
    from plyfile import PlyData

    width, height, fx, fy = map(float, Path(scene, "sparse/0/cameras.txt").read_text().split(maxsplit=6)[2:6])
    view = {"width": int(width), "height": int(height), "fx": fx, "fy": fy}
    Path(model, "cameras.json").write_text(json.dumps([view]))
    words = ["-s", scene, "-m", model, "--checkpoint_num", iterations, "--sdir", str(Path(out, "run"))]
    words += ["--mode", "train", "--msg_len", "32", "--dtype", "blender"]
    subprocess.run([sys.executable, "run_watermark.py", *words], check=True)
    offsets = torch.load(max(Path(out, "run").glob("sh_offset_*.pkl")), map_location="cpu", weights_only=True)
    ply = PlyData.read(Path(model, f"point_cloud/iteration_{iterations}/point_cloud.ply"))
    for name in ("dc", "rest"):
        added = offsets[f"features_{name}"].detach().transpose(1, 2).flatten(1).numpy()  # channel by channel, as stored
        for i, column in enumerate(added.T):
            ply["vertex"][f"f_{name}_{i}"] += column
    ply.write(Path(out, "public", "point_cloud.ply"))
    shutil.copy(Path(out, "run", "message.txt"), Path(out, "key"))
    shutil.copy(Path("decoders", DECODER), Path(out, "key"))


def detect(key, images):
    """Print the bits of every image."""
    sys.path.insert(0, "")
    import numpy as np
    import torch
    from PIL import Image
    from wm_utils import load_decoder_and_message

    decoder = load_decoder_and_message(32, key)[0]
    bits = {}
    for file in Path(images).glob("*.png"):
        image = torch.from_numpy(np.array(Image.open(file).convert("RGB"), np.float32) / 255).permute(2, 0, 1)
        with torch.no_grad():
            logits = decoder(image[None].cuda())[0]
        bits[file.stem] = "".join("1" if logit > 0 else "0" for logit in logits)
    print(json.dumps(bits))


{"embed": embed, "detect": detect}[sys.argv[1]](*sys.argv[2:])
