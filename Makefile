# Two commands do everything on a machine with Python 3.11+ and make:
#   make demo   environment, install, the main job end to end
#   make test   environment, install, lint, types, floors and the tests
PYTHON ?= python3
BIN := .venv/bin
UV := $(BIN)/uv pip install --quiet
INSTALL := $(UV) --no-deps --no-build-isolation --editable .

export OMP_NUM_THREADS ?= 1
export OPENBLAS_NUM_THREADS ?= 1
# Who has it set lets each process compile all that it imports anew: the tests begin hundreds.
unexport PYTHONDONTWRITEBYTECODE

.PHONY: demo demo-live test test-others test-slow test-trials test-arithmetic numerics without-avx512 \
	without-avx2 slow-without-avx512 slow-without-avx2 lint bench bench-short bench-peers docs tables lock clean

demo: .venv/runtime
	$(BIN)/shm demo

# A bridge that lives: permanent sensors instead of a hammer.
demo-live: .venv/runtime
	$(BIN)/shm demo --live --folder shm-demo-live

# All side by side: the types; the quick numerics, which run on another arithmetic only; and the other
# tests in three processes, because many wait for a daemon, a server or a browser. Files go out in the
# order of their names, because by their number of tests one with a single long test would come last,
# alone.
test: .venv/development
	$(MAKE) --jobs 3 lint test-arithmetic test-others

test-others: .venv/development
	$(BIN)/python -m pytest --quiet --numprocesses 3 --dist loadfile --no-loadscope-reorder \
		$(QUICK:%=--ignore=%)

# Before a release, and with `make bench`: the slow tests, which have a quicker kin in `make test`.
test-slow: .venv/development
	$(BIN)/python -m pytest --quiet --numprocesses 3 --dist loadfile --no-loadscope-reorder -m slow

test-trials: .venv/development
	$(BIN)/python -m pytest --quiet --numprocesses 2 --dist loadfile -m trial

# numpy, OpenBLAS and the C library choose by the processor how many numbers they add at once and
# whether they round between multiplying and adding: another processor gives other last digits, and
# a test that stands on them passes on one machine alone. So the quick ones of the numerics run as on
# a processor without AVX2 and FMA, which differs most; as on this one and on one without AVX-512,
# and the slow ones, with `make bench`. numpy warns, and a warning is an error here, of names that it
# does not choose by; hence it is asked for them.
CHOSEN_BY = $(shell $(BIN)/python -c "from numpy._core import _multiarray_umath as m; print(*m.__cpu_dispatch__)")
WITHOUT_AVX512 = OPENBLAS_CORETYPE=Haswell \
	NPY_DISABLE_CPU_FEATURES="$(filter X86_V4 AVX512%,$(CHOSEN_BY))"
WITHOUT_AVX2 = OPENBLAS_CORETYPE=Sandybridge NPY_DISABLE_CPU_FEATURES="$(CHOSEN_BY)" \
	GLIBC_TUNABLES=glibc.cpu.hwcaps=-FMA,-AVX2
SAMPLED := tests/gap/test_calibration.py tests/inference/test_described.py \
	tests/inference/test_other_answers.py
WATCHED := $(patsubst %,tests/watch/test_%.py,agreement baseline_check frequencies lone_baseline \
	persistence)
WORDS := $(patsubst %,tests/watch/test_%.py,alert_language alert_text)
SLOW := $(SAMPLED) $(WATCHED) $(WORDS) $(patsubst %,tests/models/test_%.py,hanger_composed models solid \
		solid_basis) \
	$(patsubst %,tests/gap/test_%.py,amplitude_slopes any_simulator attribution descent diagnose \
		discrepancy fit importance_sampling law_allowances law_error minor_cause numbering outliers \
		places readings search) \
	$(patsubst %,tests/inference/test_%.py,conditions ensemble evidence sharp updating) \
	$(patsubst %,tests/watch/test_%.py,bridge_drifts false_call_rate neighbours state \
		watcher watching)
QUICK := $(filter-out $(SLOW),$(wildcard $(patsubst %,tests/%/test_*.py,models gap inference watch)))
NUMERICS := $(BIN)/python -m pytest --quiet $(QUICK)

test-arithmetic: without-avx2

numerics: .venv/development
	$(NUMERICS)

without-avx512: .venv/development
	$(WITHOUT_AVX512) $(NUMERICS)

without-avx2: .venv/development
	$(WITHOUT_AVX2) $(NUMERICS)

slow-without-avx512: .venv/development
	$(WITHOUT_AVX512) $(BIN)/python -m pytest --quiet $(SLOW)

slow-without-avx2: .venv/development
	$(WITHOUT_AVX2) $(BIN)/python -m pytest --quiet $(SLOW)

lint: .venv/development
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports

# Goes on where it stopped, and after what fails: build/bench/table.md.
bench: .venv/development
	$(BIN)/python tests/benchmarks/every.py

# Small cases of each, an hour: whether all of them still run.
bench-short: .venv/development
	$(BIN)/python tests/benchmarks/every.py --short

# Makes the peers' environments and runs them: hours.
bench-peers: .venv/development
	$(BIN)/python tests/benchmarks/identify_peers.py --tests 10 --write-docs
	$(BIN)/python tests/benchmarks/peers.py --resume --write-docs

docs: .venv/development
	$(BIN)/python docs/build.py --quick
	$(BIN)/sphinx-build --quiet -W --keep-going -b html -d build/manual-doctrees docs build/manual
	@echo "The manual: build/manual/index.html"

# Computes the tables of docs/trials/validation.md, docs/gap.md and README.md anew: minutes.
tables: .venv/development
	$(BIN)/python docs/build.py

# Compiles the pinned files anew from pyproject.toml; hashes only, no host names.
lock: .venv/uv
	$(BIN)/uv pip compile --quiet --universal --python-version 3.11 --generate-hashes --upgrade \
		--extra build pyproject.toml --output-file requirements.txt
	$(BIN)/uv pip compile --quiet --universal --python-version 3.11 --generate-hashes \
		--extra build --extra dev --extra alerts --extra distributed --extra export --extra miniseed --extra mqtt --extra postgres --extra sso --extra tdms --extra web \
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
