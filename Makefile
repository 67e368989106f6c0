# Two commands do everything on a machine with Python 3.11+ and make:
#   make demo       environment, install, the main job end to end
#   make test       environment, install, lint, types, layers and the tests
# And these:
#   make demo-live  the same with permanent sensors
#   make lint       ruff, mypy, import-linter
#   make docs       the manual: build/manual/index.html
#   make wheel      dist/shm-VERSION-py3-none-any.whl, with the manual
#   make image      the container's image, shm:VERSION, by podman or docker
#   make bench      the slow tests and every benchmark: build/bench/table.md
#   make ablation   ROOM=watch, identify, inference or gap: what a room loses without each mechanism
#   make lock       the pinned requirement files
#   make clean      remove the environment and all that was built
# Single parts of the tests and benchmarks: make -C tests/benchmarks NAME, listed there.
PYTHON ?= python3
BIN := .venv/bin
UV := $(BIN)/uv pip install --quiet
INSTALL := $(UV) --no-deps --no-build-isolation --editable .

export OMP_NUM_THREADS ?= 1
export OPENBLAS_NUM_THREADS ?= 1
# With it set, each of the hundreds of processes that the tests start would compile all its imports.
unexport PYTHONDONTWRITEBYTECODE

.PHONY: demo demo-live test lint docs wheel image bench ablation lock clean

demo: .venv/runtime
	$(BIN)/shm demo

# A bridge that lives: permanent sensors instead of a hammer.
demo-live: .venv/runtime
	$(BIN)/shm demo --live --folder shm-demo-live

# Both parts at once, because many tests wait for a daemon, a server or a browser.
test: .venv/development
	$(MAKE) --jobs 2 --directory tests/benchmarks lint tests

lint: .venv/development
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports

docs: .venv/development
	$(BIN)/python docs/build.py --quick
	$(BIN)/sphinx-build --quiet -W --keep-going -b html -d build/manual-doctrees docs build/manual
	@echo "The manual: build/manual/index.html"

wheel: docs
	$(BIN)/python -m build --wheel --no-isolation --outdir dist .
	@echo "Install it with its extras: uv pip install --constraint requirements-dev.txt 'dist/NAME.whl[web]'"

VERSION = $(shell sed -n 's/^version = "\(.*\)"/\1/p' pyproject.toml)
CONTAINER = $(shell command -v podman || command -v docker)
image:
	@test -n "$(CONTAINER)" || { echo "Install podman or docker first." >&2; exit 1; }
	$(CONTAINER) build --file config/container/Containerfile --tag shm:$(VERSION) .

# Goes on where it stopped, and after what fails: build/bench/table.md.
bench: .venv/development
	$(BIN)/python tests/benchmarks/every.py

# A room joins by a file tests/benchmarks/ROOM_ablation.py. ARGS are its arguments: ARGS=--help.
ROOM ?= watch
ablation: .venv/development
	PYTHONPATH=. $(BIN)/python tests/benchmarks/$(ROOM)_ablation.py $(ARGS)

# Compiles the pinned files anew from pyproject.toml; hashes only, no host names.
lock: .venv/uv
	$(BIN)/uv pip compile --quiet --universal --python-version 3.11 --generate-hashes --upgrade \
		--extra build pyproject.toml --output-file requirements.txt
	$(BIN)/uv pip compile --quiet --universal --python-version 3.11 --generate-hashes \
		--extra build --extra dev --extra alerts --extra audio --extra campbell --extra distributed --extra export --extra miniseed --extra mqtt --extra postgres --extra seedlink --extra sso --extra tdms --extra web \
		--constraint requirements.txt pyproject.toml --output-file requirements-dev.txt
	echo "uv==0.13.8" | $(BIN)/uv pip compile --quiet --universal --python-version 3.11 \
		--generate-hashes - --output-file requirements-uv.txt

.venv/uv: requirements-uv.txt
	$(PYTHON) -m venv .venv
	$(BIN)/pip install --quiet --disable-pip-version-check --require-hashes --requirement requirements-uv.txt
	touch $@

.venv/runtime: .venv/uv requirements.txt pyproject.toml
	$(UV) --require-hashes --requirement requirements.txt
	$(INSTALL)
	touch $@

.venv/development: .venv/uv requirements-dev.txt pyproject.toml
	$(UV) --require-hashes --requirement requirements-dev.txt
	$(INSTALL)
	touch $@ .venv/runtime

clean:
	rm -rf .venv build dist .mypy_cache .ruff_cache .pytest_cache .hypothesis .import_linter_cache
	find . -name __pycache__ -type d -prune -exec rm -rf {} +
