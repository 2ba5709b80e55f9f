# All that people and CI call. `make demo` and `make test` do their own set-up.
.PHONY: help install torch client wire test check style types web-test api-test docs \
  release-check fix bench quality demo replay clean
.DEFAULT_GOAL := help

PYTHON ?= python3.11
BIN := .venv/bin
INSTALLED := .venv/.installed
TORCH := .venv/.torch
CLIENT := src/peaking/server/client/index.html
CORES := $(shell nproc)
KERNELS := .venv/.kernels
# A worker of pytest for every core: what each computes in threads of its own would wait for the others.
ONE_THREAD := NUMBA_NUM_THREADS=1 OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1
# Schemathesis gives the tests of all addresses one id, and of those pytest-xdist would run one.
SHARED_IDS := tests/server/test_openapi.py
# Modules that import PyTorch can be checked only where it is: in `make test`.
NEED_TORCH := ^\s*(import|from) (torch|transformers)\b
CLIENT_SOURCES := $(wildcard web/*.html web/*.json web/*.ts) $(shell find web/src -type f)

help:  ## Show this list
	@grep -hE '^[a-z-]+:.*##' $(MAKEFILE_LIST) | sed -E 's/:.*## /\t/' | expand -t 16

install: $(INSTALLED) $(CLIENT)  ## Make .venv with peaking on its path, and what the commands need
	@scripts/install_system_packages

$(INSTALLED): pyproject.toml requirements.lock scripts/make_venv
	@scripts/make_venv "$(PYTHON)"
	@touch $@

torch: $(TORCH)  ## Bring PyTorch and transformers, for learned generators, into .venv

$(TORCH): $(INSTALLED) requirements-torch.lock requirements-torch-cpu.lock requirements-torch-cuda.lock scripts/make_torch
	@scripts/make_torch
	@touch $@

$(CLIENT): $(INSTALLED) $(CLIENT_SOURCES) scripts/make_client
	@scripts/make_client
	@touch $@

client: $(CLIENT)  ## Build the web client

wire: $(INSTALLED)  ## Write the TypeScript twins of server/wire.py and server/study/wire.py
	@$(BIN)/python -m peaking.server.typescript > web/src/wire.ts
	@$(BIN)/python -m peaking.server.typescript study > web/src/study/wire.ts

demo: install  ## Start the server and open the virtual phone in the browser
	@$(BIN)/peaking demo

replay: install  ## Replay the sample scene; ends with the path of a report
	@rm -rf out/replay
	@$(BIN)/peaking replay scenes/desk --out out/replay

test: install torch  ## Pass all checks and tests, those in a real browser too
	@scripts/install_browser
	@$(MAKE) --no-print-directory --jobs $(CORES) --output-sync=recurse style types web-test api-test \
	  docs release-check
	@$(ONE_THREAD) $(BIN)/pytest -n auto --dist loadfile --no-loadscope-reorder --ignore $(SHARED_IDS)

check: style  ## Check style and types, without PyTorch
	@grep -rLE --include='*.py' '$(NEED_TORCH)' src tests examples | xargs $(BIN)/pyright

# What make test does side by side before the tests of Python, which take all cores themselves.

style: install
	@$(BIN)/ruff check
	@$(BIN)/ruff format --check
	@scripts/with_node npm --prefix web run --silent check

types: install torch
	@$(BIN)/pyright

web-test: install
	@scripts/with_node npm --prefix web run --silent test

# Compiled once, while the other core checks style and types, and not by every worker.
$(KERNELS): $(INSTALLED) $(CLIENT) $(shell find src -name '*_numba.py' -o -name '*_kernels.py')
	@scripts/install_system_packages
	@rm -rf out/kernels && mkdir -p out
	@$(BIN)/peaking replay scenes/desk --max-frames 3 --out out/kernels >out/kernels.log 2>&1 \
	  || { cat out/kernels.log; exit 1; }
	@touch $@

api-test: install $(KERNELS)
	@$(BIN)/pytest $(SHARED_IDS)

fix: install  ## Mend style where it can be done by itself
	@$(BIN)/ruff check --fix
	@$(BIN)/ruff format

docs: install  ## Write the library's pages, from its docstrings, into out/docs
	@$(BIN)/python -W error -m pdoc --docformat google --no-show-source --output-directory out/docs \
	  peaking '!peaking.'
	@echo "docs: out/docs/peaking.html"

release-check: install $(KERNELS)  ## Build the release, install it without Node.js, and try it
	@$(BIN)/python scripts/check_release.py

bench: install  ## Time the stages (peers need PyTorch: make torch)
	@$(BIN)/peaking bench

quality: install  ## Measure the MPI from one view against its peers, on the sample scene
	@$(BIN)/peaking quality

clean:  ## Remove what was made
	rm -rf .venv out web/node_modules src/peaking/server/client .pytest_cache .ruff_cache .hypothesis
