# docker build -t gspure . && docker run --rm -v "$PWD:/data" gspure audit model.ply --cameras orbit
# Apptainer: apptainer build gspure.sif docker-daemon://gspure:latest
FROM python:3.12-slim
# hdbscan has no wheel for Linux on ARM, so pip compiles it.
RUN apt-get update \
 && apt-get install -y --no-install-recommends pocl-opencl-icd libgl1 libegl1 libxrender1 \
 && if [ "$(uname -m)" = aarch64 ]; then apt-get install -y --no-install-recommends gcc libc6-dev; fi \
 && rm -rf /var/lib/apt/lists/*
COPY . /src
RUN pip install --no-cache-dir -r /src/setup/requirements.lock && pip install --no-cache-dir --no-deps /src && rm -rf /src
WORKDIR /data
ENTRYPOINT ["gspure"]
CMD ["--help"]
