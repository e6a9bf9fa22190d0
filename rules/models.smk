# Models and their views: trained from photographs, or by schemes on pairs; the user's own are used where they are. What a
# person types, `gspure pair`, is a command here, too.


use rule base_command as make_pair with:
    input:
        lambda wildcards: PLAN.pairs[wildcards.scene].inputs,
    output:
        cameras="results/pairs/{scene}/cameras.json",
        points="results/pairs/{scene}/points3D.ply",
        scene=directory("results/pairs/{scene}/scene"),
        message=directory("results/pairs/{scene}/message"),
    log:
        "results/logs/pairs/{scene}/pair.log",
    benchmark:
        "results/benchmarks/pairs/{scene}/pair.tsv"
    params:
        code=code_of("pair"),
        read=lambda wildcards: files_digest(PLAN.pairs[wildcards.scene].users_files),
        command=lambda wildcards: command(
            "pair",
            *PLAN.pairs[wildcards.scene].sources,
            "--force",
            out=f"results/pairs/{wildcards.scene}",
            **PLAN.pairs[wildcards.scene].options,
        ),
    message:
        "Making pair {wildcards.scene}"


use rule base_command as train_message with:
    output:
        model=directory("results/messages/{message}"),
    log:
        "results/logs/messages/{message}.log",
    benchmark:
        "results/benchmarks/messages/{message}.tsv"
    params:
        code=code_of("train"),
        read=lambda wildcards: files_digest(PLAN.messages[wildcards.message].users_files),
        command=lambda wildcards: command(
            "train",
            *PLAN.messages[wildcards.message].sources,
            "--force",
            out=f"results/messages/{wildcards.message}",
            **PLAN.messages[wildcards.message].options,
        ),
    message:
        "Training a model of message {wildcards.message}"


# A killed run continues from its last checkpoint, which is beside the outputs.
use rule base_command as train_model with:
    output:
        model=f"results/{VANILLA}/{{scene}}/public/point_cloud.ply",
        cameras=f"results/{VANILLA}/{{scene}}/trained/cameras.json",
    log:
        f"results/logs/{VANILLA}/{{scene}}/train.log",
    benchmark:
        f"results/benchmarks/{VANILLA}/{{scene}}/train.tsv"
    params:
        code=code_of("train"),
        read=lambda wildcards: files_digest(PLAN.trained[wildcards.scene].users_files),
        command=lambda wildcards: command(
            "train",
            *PLAN.trained[wildcards.scene].sources,
            *("--resume", "--force"),
            out=f"results/{VANILLA}/{wildcards.scene}/trained",
            model=f"results/{VANILLA}/{wildcards.scene}/public/point_cloud.ply",
            **PLAN.trained[wildcards.scene].options,
        ),
    message:
        "Training a model of {wildcards.scene}"


use rule base_command as embed_message with:
    input:
        lambda wildcards: get_model(wildcards).embedding.files,
    output:
        model="results/{scheme}/{scene}/public/point_cloud.ply",
        key=directory("results/{scheme}/{scene}/key"),
    log:
        "results/logs/{scheme}/{scene}/embed.log",
    benchmark:
        "results/benchmarks/{scheme}/{scene}/embed.tsv"
    wildcard_constraints:
        scheme=WATERMARKED,
    params:
        code=lambda wildcards: code_of("embed", *get_model(wildcards).modules),
        read=lambda wildcards: files_digest(get_model(wildcards).users_files),
        command=lambda wildcards: get_embedding(wildcards, "results/{scheme}/{scene}"),
    message:
        "Embedding the message of {wildcards.scene} with {wildcards.scheme}"


# Clean models, trained without the message, are controls.
use rule embed_message as train_clean_model with:
    output:
        model="results/{scheme}/{scene}/{clean}/public/point_cloud.ply",
    log:
        "results/logs/{scheme}/{scene}/{clean}/embed.log",
    benchmark:
        "results/benchmarks/{scheme}/{scene}/{clean}/embed.tsv"
    params:
        command=get_clean_training,
    message:
        "Training {wildcards.scheme} on {wildcards.scene} without a message"


use rule base_step as prepare_cameras with:
    input:
        get_made_model,
        lambda wildcards: get_model(wildcards).camera_inputs,
    output:
        cameras="results/{scheme}/{scene}/cameras.json",
    log:
        "results/logs/{scheme}/{scene}/cameras.log",
    benchmark:
        "results/benchmarks/{scheme}/{scene}/cameras.tsv"
    wildcard_constraints:
        scheme=VANILLA,
    threads: 1
    params:
        **step("cameras", model=get_public_model, sources=lambda wildcards: get_model(wildcards).cameras),
        read=lambda wildcards: files_digest(get_model(wildcards).camera_files),
    message:
        "Preparing the cameras of {wildcards.scheme}/{wildcards.scene}"


# The views of the message are the owner's.
use rule prepare_cameras as prepare_cameras_of_pair with:
    output:
        cameras="results/{scheme}/{scene}/cameras.json",
        message_cameras="results/{scheme}/{scene}/message_cameras.json",
    wildcard_constraints:
        scheme=WATERMARKED,
