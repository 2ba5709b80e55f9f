# All that people and CI call. `make demo` and `make test` do their own set-up.
.PHONY: help install check fix test bench quality demo clean
.DEFAULT_GOAL := help

PYTHON ?= python3.11
BIN := .venv/bin
INSTALLED := .venv/.installed

help:  ## Show this list
	@grep -hE '^[a-z]+:.*##' $(MAKEFILE_LIST) | sed -E 's/:.*## /\t/' | expand -t 12

install: $(INSTALLED)  ## Make .venv with peaking on its path, and what the commands need
	@scripts/install_system_packages

$(INSTALLED): pyproject.toml requirements.lock scripts/make_venv
	@scripts/make_venv "$(PYTHON)"
	@touch $@

demo: install  ## Replay the sample scene; ends with the path of a report
	@rm -rf out/demo
	@$(BIN)/peaking replay scenes/desk --out out/demo

test: install check  ## Pass all checks and tests
	@$(BIN)/pytest

check: install  ## Check style and types
	@$(BIN)/ruff check
	@$(BIN)/ruff format --check
	@$(BIN)/pyright

fix: install  ## Mend style where it can be done by itself
	@$(BIN)/ruff check --fix
	@$(BIN)/ruff format

bench: install  ## Time the stages (peers need the extra: .venv/bin/pip install -e '.[torch]')
	@$(BIN)/peaking bench

quality: install  ## Measure the MPI from one view against its peers, on the sample scene
	@$(BIN)/peaking quality

clean:  ## Remove what was made
	rm -rf .venv out .pytest_cache .ruff_cache .hypothesis
