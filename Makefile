# Two commands matter: `make thesis` runs the study, `make test` runs the tests. `make help` lists the rest.
# Needs make and python3 (3.11 or newer) with venv; everything else goes into $(VENV).

SHELL := /bin/bash
.SHELLFLAGS := -eu -o pipefail -c
.DEFAULT_GOAL := help
.DELETE_ON_ERROR:

PYTHON ?= python3
VENV ?= .venv
OUT ?= thesis-report
WORKERS ?= auto
# Further options of pytest, as in: make test OPTIONS='-k oe'
OPTIONS ?=
BIN := $(VENV)/bin
CREATED := $(VENV)/.created
INSTALLED := $(VENV)/.installed
SOURCES := hmtb_twin sysid scenarios tests

# One thread per library: the matrices are small, and threads that wait for each other cost more than they give.
export OPENBLAS_NUM_THREADS ?= 1
export OMP_NUM_THREADS ?= 1
export PIP_DISABLE_PIP_VERSION_CHECK := 1
export PYTHONUTF8 := 1
# Some machines set these: without bytecode every process compiles the sources anew, 10 s for each worker of the tests.
unexport PYTHONDONTWRITEBYTECODE PYTHONUNBUFFERED

.PHONY: help
help: ## list the commands
	@awk -F ':.*## ' '/^[a-z-]+:.*## /{printf "  make %-12s %s\n", $$1, $$2}' $(firstword $(MAKEFILE_LIST))

.PHONY: install
install: $(INSTALLED) ## create the environment and install the project in it

$(CREATED):
	@"$(PYTHON)" -c '' 2>/dev/null || { echo "error: no '$(PYTHON)' found; on Debian or Ubuntu: sudo apt-get install python3 python3-venv" >&2; exit 1; }
	@"$(PYTHON)" -c 'import sys; sys.exit(sys.version_info < (3, 11))' || { echo "error: $$("$(PYTHON)" --version) is too old, Python 3.11 or newer is needed; name one with: make PYTHON=python3.12 ..." >&2; exit 1; }
	@"$(PYTHON)" -c 'import venv, ensurepip' 2>/dev/null || { echo "error: '$(PYTHON)' has no venv; on Debian or Ubuntu: sudo apt-get install python3-venv" >&2; exit 1; }
	@if [ -x "$(BIN)/python" ] && "$(BIN)/python" -c 'import sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null; then \
	  echo "==> Using the environment $(VENV), which is there"; \
	else \
	  echo "==> Creating the environment $(VENV) with $$("$(PYTHON)" --version)"; \
	  rm -rf "$(VENV)"; "$(PYTHON)" -m venv "$(VENV)"; \
	fi
	@touch $@

$(INSTALLED): $(CREATED) pyproject.toml constraints.txt
	@echo "==> Installing hmtb-twin and what it needs into $(VENV) (the first time: some minutes, 2.7 GB on disk)"
	@"$(BIN)/python" -m pip install --quiet --constraint constraints.txt --editable '.[dev]'
	@touch $@

.PHONY: thesis
thesis: $(INSTALLED) ## run the whole study and write its report
	@echo "==> Running the study: simulate, identify, compare with the truth, report"
	@"$(BIN)/hmtb" thesis --out "$(OUT)"
	@echo "==> The report is $(abspath $(OUT))/report.html"

PYTEST = "$(BIN)/python" -m pytest -n $(WORKERS) --dist loadgroup --no-loadscope-reorder $(OPTIONS)

.PHONY: test
test: $(INSTALLED) ## run the tests, side by side (WORKERS=0: one after the other)
	@echo "==> Running the tests"
	@$(PYTEST) -m "not (pages or reliability or thorough)"

.PHONY: test-fast
test-fast: $(INSTALLED) ## run the tests that are not marked slow: after a change, before the next one
	@echo "==> Running the fast tests"
	@$(PYTEST) -m "not (slow or pages or reliability or thorough)"

.PHONY: docs-check
docs-check: $(INSTALLED) ## run the examples of the README, the pages and the notebooks
	@echo "==> Running the examples of the pages"
	@$(PYTEST) -m pages

.PHONY: sysid-alone
sysid-alone: ## install sysid alone into a new environment and run its tests there
	@echo "==> Installing sysid alone and running its tests"
	@"$(PYTHON)" tests/sysid_alone.py

.PHONY: test-all
test-all: $(INSTALLED) sysid-alone ## run everything that any of the other commands tests: two to four hours on two processors
	@echo "==> Running all tests"
	@$(PYTEST)

.PHONY: format-check
format-check: $(INSTALLED)
	@echo "==> Checking the format"
	@"$(BIN)/ruff" format --check $(SOURCES)

.PHONY: lint
lint: $(INSTALLED)
	@echo "==> Checking the code with ruff"
	@"$(BIN)/ruff" check $(SOURCES)

.PHONY: types
types: $(INSTALLED)
	@echo "==> Checking the types"
	@"$(BIN)/python" -m mypy

.PHONY: check
check: format-check lint types test ## format, lint, types and tests: what continuous integration runs

.PHONY: format
format: $(INSTALLED) ## put the code into the house format and mend what ruff can mend
	@"$(BIN)/ruff" format $(SOURCES)
	@"$(BIN)/ruff" check --fix $(SOURCES)

.PHONY: verification
verification: $(INSTALLED) ## measure the figures in docs again (two hours, installs the peers; DATA=folder: real data too)
	@echo "==> Installing the peers that are measured beside ours"
	@"$(BIN)/python" -m pip install --quiet --constraint constraints.txt --editable '.[dev,peers]'
	@echo "==> Measuring"
	@"$(BIN)/python" tests/benchmarks/verification.py $(if $(DATA),--data "$(DATA)")

.PHONY: images
images: $(INSTALLED) ## make the pictures of the README, of docs/maps.md and of docs/datasets.md anew
	@echo "==> Rendering the arm, running the study and drawing its result"
	@"$(BIN)/python" docs/images/make.py
	@echo "==> Making the maps of docs/maps.md"
	@"$(BIN)/python" docs/images/maps.py
	@echo "==> Building the data sets of docs/datasets.md and drawing them"
	@"$(BIN)/python" docs/images/datasets.py

.PHONY: diagrams
diagrams: $(INSTALLED) ## draw the diagrams of the pages anew for the site (needs npm and chromium)
	@npm install --silent --no-save --prefix build/mermaid mermaid@11
	@"$(BIN)/python" docs/site/diagrams.py build/mermaid/node_modules/mermaid/dist/mermaid.min.js

.PHONY: docs
docs: $(INSTALLED) ## build the site of the pages in docs and of every public name
	@echo "==> Building the site"
	@NO_MKDOCS_2_WARNING=1 "$(BIN)/mkdocs" build --quiet
	@echo "==> It is in build/site; to read it: $(BIN)/python -m http.server --directory build/site --bind 127.0.0.1"

.PHONY: wheel
wheel: $(INSTALLED) ## build the wheel and the source archive into dist
	@echo "==> Building the wheel"
	@"$(BIN)/python" -m build --no-isolation --outdir dist .

.PHONY: bench
bench: $(INSTALLED) ## run the benchmarks alone, with their figures printed
	@echo "==> Running the benchmarks"
	@"$(BIN)/python" -m pytest tests/benchmarks -s

.PHONY: constraints
constraints: ## renew constraints.txt from the newest versions that pyproject.toml allows
	@echo "==> Resolving the newest versions in a new environment"
	@rm -rf .venv-new && "$(PYTHON)" -m venv .venv-new
	@.venv-new/bin/python -m pip install --quiet --editable '.[dev,notebooks]'
	@{ sed -n '/^#/p' constraints.txt; .venv-new/bin/python -m pip freeze --exclude-editable --exclude hmtb-twin; } > constraints.new
	@mv constraints.new constraints.txt && rm -rf .venv-new

.PHONY: clean
clean: ## remove the environment, caches, builds and results
	@echo "==> Removing $(VENV), caches, builds and the default report"
	@rm -rf "$(VENV)" .ci/venv build dist thesis-report .pytest_cache .mypy_cache .ruff_cache .hypothesis *.egg-info
	@find $(wildcard $(SOURCES)) -name __pycache__ -prune -exec rm -rf {} +
