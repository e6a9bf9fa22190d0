from gspure.training.dataset import POINT_FILES

CAMERA_FILES = ["cameras.bin", "images.bin", "cameras.txt", "images.txt"]
CAMERA_FILES += ["cameras.json", "transforms.json", "transforms_train.json"]
EVIDENCE = {
    "weights": "results/{scheme}/{scene}/omega.npy",
    "prune_mask": "results/{scheme}/{scene}/prune_mask.npy",
}
TARGETS = {"planted": ["scene", "message"], "vanilla": ["scene"]}


def public_model(wildcards):
    """The model that everybody sees: the user's file where it lies, or the one that is planted or trained here."""
    made = f"results/{wildcards.scheme}/{wildcards.scene}/public/point_cloud.ply"
    return SCHEMES[wildcards.scheme][wildcards.scene].get("model", made)


def files_of(source, names):
    """The files of these names in a folder or its COLMAP model; a file stands for itself."""
    if not Path(source).is_dir():
        return [source]
    paths = [os.path.join(source, place, name) for place in ("", "sparse/0", "sparse") for name in names]
    return [path for path in paths if os.path.exists(path)]


def training_files(wildcards):
    """What a model is trained from: cameras, points, and the photographs that the cameras name."""
    source = config["assets"][wildcards.scene]["train"]
    folder = source if Path(source).is_dir() else os.path.dirname(source) or "."
    points = files_of(folder, ["points3D.bin", "points3D.txt", *POINT_FILES])
    return [*files_of(source, CAMERA_FILES), *points, *config["assets"][wildcards.scene]["photographs"]]


def training_options(wildcards):
    """The settings of training."""
    settings = config["assets"][wildcards.scene]["training"]
    return options(settings, *settings)


def camera_source(wildcards):
    """What names the views of an asset: a file or folder, a way to generate them, or what training left."""
    return config["assets"][wildcards.scene].get("cameras", f"results/vanilla/{wildcards.scene}/trained/cameras.json")


def camera_files(wildcards):
    """What the views of an asset are made from; nothing if they are generated."""
    source = camera_source(wildcards)
    return [] if source in GENERATED else files_of(source, CAMERA_FILES)


def camera_options(wildcards, input):
    """How the views of an asset are scaled or generated."""
    asset = config["assets"][wildcards.scene]
    if camera_source(wildcards) in GENERATED:
        return f"--model {shlex.quote(input.model)} {options(asset['generated'], *asset['generated'])}"
    return options(asset, "scale")


def attack_of(wildcards):
    """The attack behind a variant."""
    return find_attack(VARIANTS[wildcards.variant]["attack"])


def attack_input(wildcards):
    """The public model, and what the attack has measured on it."""
    evidence = {need: EVIDENCE[need].format(**wildcards) for need in sorted(attack_of(wildcards).needs)}
    return {"model": public_model(wildcards), **evidence}


def attack_options(wildcards, input):
    """The evidence, the seed and the settings of a variant."""
    settings = dict(VARIANTS[wildcards.variant])
    del settings["attack"]
    given = {name: path for name, path in input.items() if name in EVIDENCE} | {"seed": settings.pop("seed")}
    assigned = [word for name, value in settings.items() for word in ("--set", f"{name}={value}")]
    return f"{options(given, *given)} {shlex.join(assigned)}"


def rendered_model(wildcards):
    """The model behind the images of a target."""
    model = "public/point_cloud.ply" if wildcards.target == "scene" else "message.ply"
    return f"results/{wildcards.scheme}/{wildcards.scene}/{wildcards.variant}/{model}"


def renders(wildcards):
    """The folders of images of a variant."""
    return expand("results/{scheme}/{scene}/{variant}/renders/{target}", target=TARGETS[wildcards.scheme], **wildcards)


def references(wildcards):
    """The folders of images that a variant is compared with, in the order of `renders`."""
    if wildcards.scheme == "planted":
        return expand("results/planted/{scene}/truth/{target}", target=TARGETS["planted"], scene=wildcards.scene)
    return expand("results/vanilla/{scene}/watermarked/renders/scene", scene=wildcards.scene)


def panel_columns(wildcards):
    """The folders of images beside each other in a panel, by title: the reference, then before and after."""
    renders = f"results/{wildcards.scheme}/{wildcards.scene}/{{variant}}/renders/{wildcards.target}"
    columns = {variant: renders.format(variant=variant) for variant in ("watermarked", "gspure")}
    if wildcards.scheme == "planted":
        columns = {"truth": f"results/planted/{wildcards.scene}/truth/{wildcards.target}", **columns}
    return columns


def truth_of(scheme, scene):
    """The mask of the Gaussians that carry the message, where it is known."""
    return [f"results/planted/{scene}/key/carriers.npy"] if scheme == "planted" else []


def figure_files():
    """All figures, in the order in which the page shows them; those of a model are files of one folder."""
    files = []
    for scheme, scenes in SCHEMES.items():
        truth = ["model/truth"] if scheme == "planted" else []
        clouds = [*truth, "model/kept", "model/clusters", "model/ranks"]
        names = ["outcomes", "model/weights", *TARGETS[scheme], *clouds]
        files += [f"results/{scheme}/{scene}/figures/{name}.png" for scene in scenes for name in names]
    return files
