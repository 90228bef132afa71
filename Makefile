# Every target needs only python3 (with venv) and make; the first one run sets everything up in
# .venv.
PYTHON ?= python3
VENV ?= .venv
BIN := $(VENV)/bin
READY := $(VENV)/.ready
BROWSER := $(VENV)/.browser
COMPILERS := $(VENV)/.compilers
TORCH := $(VENV)/.torch
UV_VERSION := 0.13.8
TORCH_VERSION := 2.15.0
OLDEST := $(VENV)/oldest
LOCKED := engines viewer control video fmu sympy jax gym sweeps
comma := ,
space := $() $()

.PHONY: demo test long hostile oldest bench docs lock clean

demo: $(READY)  ## reproduce the paper: report.html and its data in ./demo
	$(BIN)/linkwork reproduce --out demo

PYTEST := OPENBLAS_NUM_THREADS=1 $(BIN)/python -m pytest -n 2

test: $(READY) $(BROWSER) $(COMPILERS) $(TORCH)  ## lint, types, all tests but the long ones
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	# Types are checked meanwhile, which takes one processor a minute, less where its garbage is
	# looked for seldom; both have to pass.
	NODE_OPTIONS=--max-semi-space-size=64 $(BIN)/pyright & types=$$!; \
	PYTHONDONTWRITEBYTECODE= $(PYTEST) --dist worksteal -m "not long"; tests=$$?; \
	wait $$types && exit $$tests

long: $(READY) $(BROWSER) $(COMPILERS) $(TORCH)  ## the tests that `make test` leaves out, for they take long
	PYTHONDONTWRITEBYTECODE= $(PYTEST) --dist worksteal -m long

hostile: $(READY) $(TORCH)  ## every hostile case, every mutated file and all robots where one of each kind stands for them in `make test`
	LINKWORK_HOSTILE=all $(PYTEST) tests/hostile tests/analysis tests/benchmarks tests/control tests/design tests/equations tests/export tests/formats \
	    tests/gradients tests/gym tests/jax tests/kernels tests/lab tests/mechanism tests/motions tests/robot tests/sweeps tests/torch --dist loadgroup

oldest: $(READY)  ## most tests with the oldest versions of other packages that pyproject.toml allows, in an environment of its own
	$(BIN)/uv venv --quiet --clear --python $(BIN)/python $(OLDEST)
	VIRTUAL_ENV=$(OLDEST) $(BIN)/uv pip install --quiet --resolution lowest-direct --group tests --editable .[$(subst $(space),$(comma),$(LOCKED))]
	OPENBLAS_NUM_THREADS=1 $(OLDEST)/bin/python -m pytest -n 2 --ignore tests/benchmarks --ignore tests/docs --ignore tests/torch

bench: $(READY)  ## every must-reach figure, contenders interleaved; tables into benchmarks/results
	$(BIN)/python -m benchmarks

docs: $(READY)  ## the documentation as a site, in ./site; nothing is loaded from a network, neither now nor when it is read
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --strict

lock:  ## resolve the dependencies anew; the lock names no registry, so it works with any index or mirror, and holds PyTorch not: see there
	$(BIN)/uv pip compile pyproject.toml $(addprefix --extra ,$(LOCKED)) --group dev --universal --generate-hashes \
	    --no-emit-index-url --no-header --upgrade --output-file requirements.lock

$(READY): requirements.lock pyproject.toml
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check uv==$(UV_VERSION)
	VIRTUAL_ENV=$(VENV) $(BIN)/uv pip install --quiet --compile-bytecode --require-hashes --requirements requirements.lock
	VIRTUAL_ENV=$(VENV) $(BIN)/uv pip install --quiet --no-deps --no-build-isolation --editable .
	touch $@

$(BROWSER): $(READY) tests/viewer/chromium.sh  # a Chromium for the viewer's tests, where none is installed; without one they are skipped and say so
	sh tests/viewer/chromium.sh $(BIN)/playwright
	touch $@

$(COMPILERS): $(READY) tests/export/compilers.sh  # compilers and processors for the tests of exported C; those of what is missing are skipped and say so
	sh tests/export/compilers.sh
	touch $@

$(TORCH): $(READY)  # PyTorch for processors alone from its own index, a tenth as large; where that is out of reach, the one of the package index
	VIRTUAL_ENV=$(VENV) $(BIN)/uv pip install --quiet --compile-bytecode --torch-backend cpu --constraints requirements.lock torch==$(TORCH_VERSION) 2>/dev/null || \
	    VIRTUAL_ENV=$(VENV) $(BIN)/uv pip install --quiet --compile-bytecode --constraints requirements.lock torch==$(TORCH_VERSION)
	touch $@

clean:
	rm -rf $(VENV) demo site .pytest_cache .ruff_cache
