from gspure.evaluation.controls import BASELINES, OTHER_SCENE, WRONG_KEY
from gspure.workflow.captures import camera_files, capture_files
from gspure.workflow.pairs import (
    is_photographed,
    other_pair,
    pair_arguments,
    pair_files,
    pair_of,
    repetition_of,
    trained_message,
)

EXTRACTIONS = {name: scheme.extractions for name, scheme in WATERMARKS.items()}
TARGETS = {"vanilla": ["scene"]} | {name: ["scene", *extractions] for name, extractions in EXTRACTIONS.items()}


def pair_inputs(wildcards):
    """What a scheme is trained on."""
    folder = f"results/pairs/{pair_of(wildcards.scene)}"
    names = {"cameras": "cameras.json", "points": "points3D.ply", "scene": "scene", "message": "message"}
    return {name: f"{folder}/{file}" for name, file in names.items()}


def public_model(wildcards):
    """The model that everybody sees: the user's file where it lies, or the one that is trained here."""
    made = f"results/{wildcards.scheme}/{wildcards.scene}/public/point_cloud.ply"
    return SCHEMES[wildcards.scheme][wildcards.scene].get("model", made)


def get_training_files(wildcards):
    """What a model is trained from: cameras, points, and the photographs that the cameras name."""
    asset = config["assets"][wildcards.scene]
    return capture_files(asset["train"], asset["photographs"])


def get_training_options(wildcards):
    """The settings of training."""
    settings = config["assets"][wildcards.scene]["training"]
    return options(settings, *settings)


def get_pair_files(wildcards):
    """What a pair is made from."""
    return pair_files(config["pairs"][wildcards.scene])


def get_pair_arguments(wildcards):
    """The scene, the message and the settings of a pair."""
    return pair_arguments(config["pairs"][wildcards.scene], config["views"]["off_path"])


MESSAGES = {trained_message(pair): pair for pair in config["pairs"].values() if "message_photographs" in pair}


def get_message_files(wildcards):
    """What the model of a message is trained from."""
    pair = MESSAGES[wildcards.message]
    return capture_files(pair["message"], pair["message_photographs"])


def embedding_code(wildcards):
    """The code behind the training of a scheme."""
    return code_digest("gspure.cli.embed", WATERMARKS[wildcards.scheme].embed.__module__)


def embedding_options(wildcards):
    """The seed and the settings of a scheme's training."""
    settings = dict(config["schemes"][wildcards.scheme])
    seed = settings.pop("seed") + repetition_of(wildcards.scene)
    return f"--seed {seed} {setting_options(settings)}"


def camera_source(wildcards):
    """What names the views of an asset: a pair, a file or folder, a way to generate them, or what training left."""
    if wildcards.scheme in WATERMARKS:
        return pair_inputs(wildcards)["cameras"]
    return config["assets"][wildcards.scene].get("cameras", f"results/vanilla/{wildcards.scene}/trained/cameras.json")


def get_camera_files(wildcards):
    """What the views of an asset are made from; nothing if they are generated."""
    source = camera_source(wildcards)
    if wildcards.scheme in WATERMARKS:
        return [source]
    return [] if source in GENERATED else camera_files(source)


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
    sources = {"weights": made("weights.npy"), "prune_mask": made("prune_mask.npy")}
    sources |= {"opacities": opacities, "surface": surface}
    evidence = {need: sources[need](wildcards) for need in sorted(attack_of(wildcards).needs)}
    return {"model": public_model(wildcards), **evidence}


def attack_options(wildcards, input):
    """The evidence, the seed and the settings of a variant; `tau`, if not set, is tau_n of its decision."""
    own = VARIANTS[wildcards.variant]
    given = {name: path for name, path in input.items() if name in attack_of(wildcards).needs}
    given["seed"] = own["seed"] + repetition_of(wildcards.scene)
    settings = {name: value for name, value in own.items() if name in attack_of(wildcards).settings}
    if "tau" in attack_of(wildcards).settings:
        settings.setdefault("tau", settings_of(wildcards)["tau_n"])
    if wildcards.scheme in WATERMARKS:
        given["scheme"] = wildcards.scheme
    return f"{options(given, *given)} {setting_options(settings)}"


def model_of(wildcards):
    """The model that a variant or a control shows."""
    folder = f"results/{wildcards.scheme}/{wildcards.scene}"
    if wildcards.variant == OTHER_SCENE:
        other = other_pair(config["pairs"], pair_of(wildcards.scene))
        return f"results/{wildcards.scheme}/{other}/public/point_cloud.ply"
    if wildcards.variant == WRONG_KEY:
        return f"{folder}/public/point_cloud.ply"
    return f"{folder}/{wildcards.variant}/public/point_cloud.ply"


def world_of(wildcards):
    """By what an attack moved the model, so that views move along."""
    moved = wildcards.variant in VARIANTS
    return {"world": f"results/{wildcards.scheme}/{wildcards.scene}/{wildcards.variant}/world.npy"} if moved else {}


def off_path(wildcards):
    """The views beside the path: of all models but those of photographed pairs, whose truth is not known there."""
    own = SCHEMES[wildcards.scheme][wildcards.scene]
    if not config["views"]["off_path"] or (wildcards.scheme in WATERMARKS and is_photographed(own)):
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


def controls(scheme, scene):
    """The negative controls of a model; another scene's model takes a pair with another message."""
    if scheme not in WATERMARKS:
        return []
    return [control for control in CONTROLS if control != OTHER_SCENE or other_pair(config["pairs"], pair_of(scene))]


def targets(wildcards):
    """What is looked at of a variant; only messages are of controls whose scene is another's or the same."""
    found = TARGETS[wildcards.scheme]
    return found[1:] if wildcards.variant in (WRONG_KEY, OTHER_SCENE) else found


def renders(wildcards):
    """The folders of images of a variant; a baseline covers the views of the unattacked model."""
    variant = "unattacked" if wildcards.variant in BASELINES else wildcards.variant
    folder = f"results/{wildcards.scheme}/{wildcards.scene}/{variant}/renders"
    return [f"{folder}/{target}" for target in targets(wildcards)]


def references(wildcards):
    """The folders of images that a variant is compared with."""
    if wildcards.scheme in WATERMARKS:
        return [pair_inputs(wildcards)[target] for target in ("scene", "message")]
    return expand("results/vanilla/{scene}/unattacked/renders/scene", scene=wildcards.scene)


def comparison_options(wildcards):
    """What images are compared with, and what stands in for what."""
    assigned = [f"--against {name}=message" for name in [*EXTRACTIONS.get(wildcards.scheme, [])][1:]]
    baseline = [f"--baseline {wildcards.variant}"] if wildcards.variant in BASELINES else []
    return " ".join([f"--reference {'render' if wildcards.scheme == 'vanilla' else 'truth'}", *assigned, *baseline])


def shown_folders(wildcards):
    """The folders of images, with one folder for each target, by title: the truth where it is known, then variants."""
    folder = f"results/{wildcards.scheme}/{wildcards.scene}"
    truth = {"truth": f"results/pairs/{pair_of(wildcards.scene)}"} if wildcards.scheme in WATERMARKS else {}
    others = sorted(VARIANTS, key=lambda variant: variant != "unattacked")
    return truth | {variant: f"{folder}/{variant}/renders" for variant in others}


def panel_columns(wildcards):
    """The folders of images beside each other in a panel, by title: the reference, then before and after."""
    shown = shown_folders(wildcards)
    targets = {"truth": wildcards.target.partition("_")[0]}
    titles = [title for title in ("truth", "unattacked", "gspure") if title in shown]
    return {title: f"{shown[title]}/{targets.get(title, wildcards.target)}" for title in titles}


def metrics_files(scheme, scene):
    """The metrics of all variants and controls of a model."""
    return [f"results/{scheme}/{scene}/{variant}/metrics.csv" for variant in [*VARIANTS, *controls(scheme, scene)]]


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
