# `make demo` and `make test` do all the set-up they need; see `make help`.

VENV := .venv
BIN := $(VENV)/bin
PIP := $(BIN)/pip --quiet --disable-pip-version-check
LOCK := $(BIN)/uv pip compile --quiet --universal --python-version 3.11 --no-emit-index-url --no-annotate --custom-compile-command "make lock"
SNAKEFILES := Snakefile rules

# Each step of the set-up leaves one of these behind when it is done.
PACKAGES := $(VENV)/.packages
DEV_PACKAGES := $(VENV)/.packages-dev
DOCS_PACKAGES := $(VENV)/.packages-docs
OPENCL := $(VENV)/.opencl
GL := $(VENV)/.gl
BROWSER := $(VENV)/.browser

.PHONY: help demo test test-all setup opencl gl lint format docs bench gpu lock clean
.DELETE_ON_ERROR:
.NOTPARALLEL:

help: ## show this
	@awk -F ':.*## ' '/^[a-z-]+:.*## / { printf "  make %-8s %s\n", $$1, $$2 }' $(MAKEFILE_LIST)

demo: $(OPENCL) $(GL) ## set up, then run the whole evaluation on a scene made here: results/report.html
	@$(BIN)/gspure demo

test: $(DEV_PACKAGES) $(OPENCL) $(GL) $(BROWSER) ## set up, then run the tests, two files at a time
	@$(BIN)/python -m pytest -n 2 --dist loadfile --no-loadscope-reorder

test-all: $(DEV_PACKAGES) $(OPENCL) $(GL) $(BROWSER) ## all tests, with more hostile files, and mutants: hours
	@GSPURE_EXAMPLES=2000 $(BIN)/python -m pytest -n 2 --dist loadfile
	@$(BIN)/python setup/mutants.py

setup: $(OPENCL) $(GL) ## set up only: .venv, packages, an OpenCL driver, OpenGL
	@echo "Set up. Try: $(BIN)/gspure doctor"

opencl: ## look for a working OpenCL device again, and install a driver if there is none
gl: ## look for a working OpenGL again, and install one if there is none
opencl gl:
	@rm -f $(VENV)/.$@
	@$(MAKE) --no-print-directory $(VENV)/.$@

lint: $(DEV_PACKAGES) ## check style, types and the workflow
	@$(BIN)/ruff check .
	@$(BIN)/ruff format --check .
	@$(BIN)/mypy
	@$(BIN)/snakefmt --check $(SNAKEFILES)
	@$(BIN)/snakemake --lint

format: $(DEV_PACKAGES) ## put the code into the style that lint checks
	@$(BIN)/ruff check --fix-only .
	@$(BIN)/ruff format .
	@$(BIN)/snakefmt $(SNAKEFILES)

docs: $(DOCS_PACKAGES) ## build the documentation: build/site
	@NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --quiet --strict
	@echo "The documentation: $(CURDIR)/build/site/index.html"

bench: $(DEV_PACKAGES) $(OPENCL) ## measure speed, and add a row to benchmarks/history.csv
	@$(BIN)/python -m pytest benchmarks
	@$(BIN)/python -m benchmarks.history

gpu: $(DEV_PACKAGES) $(OPENCL) ## with a GPU: test its kernels, measure contributions and training, beside gsplat if installed
	@$(BIN)/python -c "from gspure.opencl.device import choose_device; d = choose_device(); assert d.kind == 'gpu', f'no GPU but {d}'"
	@$(BIN)/python -m pytest tests/test_kernels.py tests/test_renderer.py tests/test_gradients.py tests/test_trainable.py
	@$(BIN)/python -m experiments.drivers
	@$(BIN)/python -m pytest benchmarks/bench_views.py benchmarks/bench_training.py benchmarks/bench_gsplat.py --record gpu

lock: $(DEV_PACKAGES) ## choose the newest versions that pyproject.toml allows, and write them down
	@$(PIP) install uv
	@$(LOCK) --upgrade pyproject.toml --output-file setup/requirements.lock
	@$(LOCK) --upgrade pyproject.toml --output-file setup/requirements-dev.lock --extra dev --constraints setup/requirements.lock
	@$(LOCK) --upgrade pyproject.toml --output-file setup/requirements-docs.lock --extra docs --constraints setup/requirements-dev.lock

clean: ## remove the set-up and all caches; results and stages stay
	@rm -rf $(VENV) build dist .pytest_cache .ruff_cache .mypy_cache .hypothesis .benchmarks
	@find . -name __pycache__ -type d -prune -exec rm -rf {} +

$(BIN)/pip: setup/python.sh
	@setup/python.sh $(VENV)
	@touch $@

$(PACKAGES): $(BIN)/pip setup/requirements.lock pyproject.toml
	@echo "setup: installing the packages (about 1 GB, a minute or two)"
	@$(PIP) install --use-pep517 --no-deps --requirement setup/requirements.lock
	@$(PIP) install --no-deps --editable .
	@touch $@

$(DEV_PACKAGES): $(PACKAGES) setup/requirements-dev.lock
	@echo "setup: installing what the tests need"
	@$(PIP) install --use-pep517 --no-deps --no-compile --requirement setup/requirements-dev.lock
	@touch $@

$(DOCS_PACKAGES): $(PACKAGES) setup/requirements-docs.lock
	@echo "setup: installing what the documentation needs"
	@$(PIP) install --use-pep517 --no-deps --no-compile --requirement setup/requirements-docs.lock
	@touch $@

$(OPENCL): $(PACKAGES) setup/opencl.sh
	@setup/opencl.sh $(VENV)
	@touch $@

$(GL): $(PACKAGES) setup/gl.sh
	@setup/gl.sh $(VENV)
	@touch $@

$(BROWSER): $(PACKAGES) setup/browser.sh
	@setup/browser.sh
	@touch $@
