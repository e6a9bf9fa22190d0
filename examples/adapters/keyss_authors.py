"""Call KeySS's programs in the current folder: embed, extract, or make a wrong key (keyss_authors.toml)."""

import random
import shutil
import string
import subprocess
import sys
from pathlib import Path

FEATURES = ["--fealist", "opacity,rotation,xyz,scale"]  # of its run_train.sh
RENDERED = "sh_degree=3, images='images', resolution=-1, white_background=False, data_device='cuda', eval=False"
DECODER = "decoder_iter30000.pth"
PLY = "point_cloud_iter30000.ply"
PROMPT = "prompt.txt"


def prompt(seed):
    """Return 16 random letters; KeySS trains its decoder to refuse such prompts."""
    return "".join(random.Random(seed).choices(string.ascii_letters, k=16))  # noqa: S311


def embed(scene, message, out, seed, scene_ply, message_ply):
    """Train, with a prompt that depends on the seed."""
    text = prompt(seed)
    key = Path(out, "key")
    Path(key, PROMPT).write_text(text)
    words = ["-s", scene, "--source_path_secret", message, "--hide_path", scene_ply, "--all_path", message_ply]
    words += ["--save_path", out, "--prompt", text, *FEATURES]
    subprocess.run([sys.executable, "train2hide_prompt_random_fast16.py", *words], check=True)
    shutil.move(Path(out, PLY), Path(out, "public", "point_cloud.ply"))
    shutil.move(Path(out, DECODER), Path(key, DECODER))


def extract(key, model, cameras, out):
    """Render the secret in all views; the program writes images in the order of the views' names."""
    Path(cameras, "cfg_args").write_text(f"Namespace({RENDERED})")
    words = ["-s", cameras, "-m", cameras, "--loadpath", Path(model, "point_cloud.ply"), "--savepath", out]
    words += ["--decpth", Path(key, DECODER), "--prompt", Path(key, PROMPT).read_text(), *FEATURES]
    subprocess.run([sys.executable, "render_secret_prompt_random16.py", *words], check=True)
    for image in Path(out, "renders").iterdir():
        image.rename(Path(out, image.name))


def wrong(key, out, seed):
    """Copy the decoder, and write another prompt."""
    shutil.copy(Path(key, DECODER), out)
    Path(out, PROMPT).write_text(prompt(seed))


{"embed": embed, "extract": extract, "wrong": wrong}[sys.argv[1]](*sys.argv[2:])
