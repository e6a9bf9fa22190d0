from gspure.artifacts import digest
from gspure.evaluation.controls import BASELINES, OTHER_SCENE, WRONG_KEY
from gspure.training.dataset import POINT_FILES

CAMERA_FILES = ["cameras.bin", "images.bin", "cameras.txt", "images.txt"]
CAMERA_FILES += ["cameras.json", "transforms.json", "transforms_train.json"]
EXTRACTIONS = {name: scheme.extractions for name, scheme in WATERMARKS.items()}
TARGETS = {"planted": ["scene", "message"], "vanilla": ["scene"]}
TARGETS |= {name: ["scene", *extractions] for name, extractions in EXTRACTIONS.items()}


def pair_of(scene):
    """The name of an asset's pair: raised, of raised@1."""
    return scene.partition("@")[0]


def repetition(wildcards):
    """What an asset's repetition adds to all seeds: 1, of raised@1."""
    return int(wildcards.scene.partition("@")[2] or 0)


def pair_inputs(wildcards):
    """What a scheme is trained on."""
    folder = f"results/pairs/{pair_of(wildcards.scene)}"
    names = {"cameras": "cameras.json", "points": "points3D.ply", "scene": "scene", "message": "message"}
    return {name: f"{folder}/{file}" for name, file in names.items()}


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
    asset = config["assets"][wildcards.scene]
    return photograph_files(asset["train"], asset["photographs"])


def photograph_files(source, photographs):
    """The files of a capture: cameras, points and photographs."""
    folder = source if Path(source).is_dir() else os.path.dirname(source) or "."
    points = files_of(folder, ["points3D.bin", "points3D.txt", *POINT_FILES])
    return [*files_of(source, CAMERA_FILES), *points, *photographs]


def training_options(wildcards):
    """The settings of training."""
    settings = config["assets"][wildcards.scene]["training"]
    return options(settings, *settings)


def pair_files(wildcards):
    """What a pair is made from: nothing if it is ray-traced, else photographs and the message's model."""
    pair = config["pairs"][wildcards.scene]
    if not photographed(pair):
        return []
    return [*photograph_files(pair["scene"], pair["photographs"]), message_model(pair)]


def photographed(pair):
    """Whether a pair is made from photographs."""
    return "photographs" in pair


def message_model(pair):
    """The model of a photographed pair's message: the user's, or the one that is trained here for all who hide it."""
    return f"results/messages/{trained_message(pair)}" if "message_photographs" in pair else pair["message"]


def trained_message(pair):
    """The name of a message's model: that of its folder, and a digest of all that it is trained with."""
    settings = [str(pair[name]) for name in ("message", "iterations", "resolution", "seed")]
    return f"{Path(pair['message']).stem}-{digest(*settings)[:8]}"


def pair_sources(wildcards):
    """The scene and the message of a pair, as its command takes them."""
    pair = config["pairs"][wildcards.scene]
    return shlex.join([pair["scene"], message_model(pair)])


def pair_options(wildcards):
    """The settings of a pair that apply to it."""
    pair = config["pairs"][wildcards.scene]
    if photographed(pair):
        return options(pair, "resolution", "seed")
    traced = {**pair, "off_path": config["views"]["off_path"]}
    return options(traced, "placement", "views", "width", "height", "off_path", "seed")


MESSAGES = {trained_message(pair): pair for pair in config["pairs"].values() if "message_photographs" in pair}


def message_files(wildcards):
    """What the model of a message is trained from."""
    pair = MESSAGES[wildcards.message]
    return photograph_files(pair["message"], pair["message_photographs"])


def embedding_code(wildcards):
    """The code behind the training of a scheme."""
    return code_digest("gspure.cli.embed", WATERMARKS[wildcards.scheme].embed.__module__)


def embedding_options(wildcards):
    """The seed and the settings of a scheme's training."""
    settings = dict(config["schemes"][wildcards.scheme])
    seed = settings.pop("seed") + repetition(wildcards)
    assigned = [word for name, value in settings.items() for word in ("--set", f"{name}={value}")]
    return shlex.join(["--seed", str(seed), *assigned])


def camera_source(wildcards):
    """What names the views of an asset: a pair, a file or folder, a way to generate them, or what training left."""
    if wildcards.scheme in WATERMARKS:
        return pair_inputs(wildcards)["cameras"]
    return config["assets"][wildcards.scene].get("cameras", f"results/vanilla/{wildcards.scene}/trained/cameras.json")


def camera_files(wildcards):
    """What the views of an asset are made from; nothing if they are generated."""
    source = camera_source(wildcards)
    if wildcards.scheme in WATERMARKS:
        return [source]
    return [] if source in GENERATED else files_of(source, CAMERA_FILES)


def camera_options(wildcards, input):
    """How the views of an asset are scaled or generated."""
    if wildcards.scheme in WATERMARKS:
        return "--scale native"
    asset = config["assets"][wildcards.scene]
    if camera_source(wildcards) in GENERATED:
        return f"--model {shlex.quote(input.model)} {options(asset['generated'], *asset['generated'])}"
    return options(asset, "scale")


def attack_of(wildcards):
    """The attack behind a variant."""
    return find_attack(VARIANTS[wildcards.variant]["attack"])


def attack_input(wildcards):
    """The public model, and what the attack has measured on it."""
    sources = {"weights": made("omega.npy"), "prune_mask": made("prune_mask.npy")}
    sources |= {"opacities": opacities, "surface": surface}
    evidence = {need: sources[need](wildcards) for need in sorted(attack_of(wildcards).needs)}
    return {"model": public_model(wildcards), **evidence}


def attack_options(wildcards, input):
    """The evidence, the seed and the settings of a variant; `tau`, if not set, is tau_n of its decision."""
    own = VARIANTS[wildcards.variant]
    given = {name: path for name, path in input.items() if name in attack_of(wildcards).needs}
    given["seed"] = own["seed"] + repetition(wildcards)
    settings = {name: value for name, value in own.items() if name in attack_of(wildcards).settings}
    if "tau" in attack_of(wildcards).settings:
        settings.setdefault("tau", settings_of(wildcards)["tau_n"])
    if wildcards.scheme in WATERMARKS:
        given["scheme"] = wildcards.scheme
    assigned = [word for name, value in settings.items() for word in ("--set", f"{name}={value}")]
    return f"{options(given, *given)} {shlex.join(assigned)}"


def model_of(wildcards):
    """The model that a variant or a control shows."""
    folder = f"results/{wildcards.scheme}/{wildcards.scene}"
    if wildcards.variant == OTHER_SCENE:
        return f"results/{wildcards.scheme}/{other_pair(pair_of(wildcards.scene))}/public/point_cloud.ply"
    if wildcards.variant == WRONG_KEY:
        return f"{folder}/public/point_cloud.ply"
    if wildcards.scheme == "planted" and wildcards.target == "message":
        return f"{folder}/{wildcards.variant}/message.ply"
    return f"{folder}/{wildcards.variant}/public/point_cloud.ply"


def world_of(wildcards):
    """By what an attack moved the model, so that views move along."""
    moved = wildcards.variant in VARIANTS
    return {"world": f"results/{wildcards.scheme}/{wildcards.scene}/{wildcards.variant}/world.npy"} if moved else {}


def off_path(wildcards):
    """The views beside the path: of all models but those of photographed pairs, whose truth is not known there."""
    own = SCHEMES[wildcards.scheme][wildcards.scene]
    if not config["views"]["off_path"] or (wildcards.scheme in WATERMARKS and photographed(own)):
        return {}
    return {"off_path": f"results/{wildcards.scheme}/{wildcards.scene}/off_path.json"}


def view_options(wildcards, input):
    """The views of a variant beside those of its cameras, and by what the attack moved the model."""
    given = {name.replace("_", "-"): input[name] for name in (*off_path(wildcards), *world_of(wildcards))}
    return options(given, *given)


def extraction_options(wildcards):
    """How a message is looked for."""
    stranger = " --wrong-key 1" if wildcards.variant == WRONG_KEY else ""
    return f"--scheme {wildcards.scheme} --extraction {wildcards.target}{stranger}"


def other_pair(pair):
    """The first pair with another message than this one's; none if there is no such pair."""
    pairs = config["pairs"]
    return next((name for name, own in pairs.items() if own["message"] != pairs[pair]["message"]), None)


def controls(scheme, scene):
    """The negative controls of a model; another scene's model takes a pair with another message."""
    if scheme not in WATERMARKS:
        return []
    return [control for control in CONTROLS if control != OTHER_SCENE or other_pair(pair_of(scene))]


def targets(wildcards):
    """What is looked at of a variant; only messages are of controls whose scene is another's or the same."""
    found = TARGETS[wildcards.scheme]
    return found[1:] if wildcards.variant in (WRONG_KEY, OTHER_SCENE) else found


def renders(wildcards):
    """The folders of images of a variant; a baseline covers the views of the watermarked model."""
    variant = "watermarked" if wildcards.variant in BASELINES else wildcards.variant
    folder = f"results/{wildcards.scheme}/{wildcards.scene}/{variant}/renders"
    return [f"{folder}/{target}" for target in targets(wildcards)]


def references(wildcards):
    """The folders of images that a variant is compared with."""
    if wildcards.scheme == "planted":
        return expand("results/planted/{scene}/truth/{target}", target=TARGETS["planted"], scene=wildcards.scene)
    if wildcards.scheme in WATERMARKS:
        return [pair_inputs(wildcards)[target] for target in ("scene", "message")]
    return expand("results/vanilla/{scene}/watermarked/renders/scene", scene=wildcards.scene)


def comparison_options(wildcards):
    """What images are compared with, and what stands in for what."""
    assigned = [f"--against {name}=message" for name in [*EXTRACTIONS.get(wildcards.scheme, [])][1:]]
    baseline = [f"--baseline {wildcards.variant}"] if wildcards.variant in BASELINES else []
    return " ".join([f"--reference {'render' if wildcards.scheme == 'vanilla' else 'truth'}", *assigned, *baseline])


def shown_folders(wildcards):
    """The folders of images, with one folder for each target, by title: the truth where it is known, then variants."""
    folder = f"results/{wildcards.scheme}/{wildcards.scene}"
    truths = {"planted": f"{folder}/truth"} | dict.fromkeys(WATERMARKS, f"results/pairs/{pair_of(wildcards.scene)}")
    truth = {"truth": truths[wildcards.scheme]} if wildcards.scheme in truths else {}
    others = sorted(VARIANTS, key=lambda variant: variant != "watermarked")
    return truth | {variant: f"{folder}/{variant}/renders" for variant in others}


def panel_columns(wildcards):
    """The folders of images beside each other in a panel, by title: the reference, then before and after."""
    shown = shown_folders(wildcards)
    targets = {"truth": wildcards.target.partition("_")[0]}
    titles = [title for title in ("truth", "watermarked", "gspure") if title in shown]
    return {title: f"{shown[title]}/{targets.get(title, wildcards.target)}" for title in titles}


def metrics_files(scheme, scene):
    """The metrics of all variants and controls of a model."""
    return [f"results/{scheme}/{scene}/{variant}/metrics.csv" for variant in [*VARIANTS, *controls(scheme, scene)]]


def truth_of(scheme, scene):
    """The mask of the Gaussians that carry the message, where it is known."""
    return [f"results/planted/{scene}/key/carriers.npy"] if scheme == "planted" else []


def hidden_of(scheme, scene):
    """What each row weighs in views of the message, where a scheme has hidden one."""
    return [f"results/{scheme}/{scene}/hidden.npy"] if scheme in WATERMARKS else []


def figure_files():
    """All figures, in the order in which the page shows them; those of a model are files of one folder."""
    files = []
    for scheme, scenes in SCHEMES.items():
        clouds = ["kept", "clusters", "ranks"] if scheme == "vanilla" else ["purification", "kept", "clusters"]
        names = ["outcomes", "attacks", "model/weights", *TARGETS[scheme], *(f"model/{name}" for name in clouds)]
        shown = [scene for scene in scenes if get_finished(metrics_files(scheme, scene))]
        files += [f"results/{scheme}/{scene}/figures/{name}.png" for scene in shown for name in names]
    return files
