# Everything runs from a virtual environment in .venv, which the first target that needs it makes.
# A stamp records each installation, so that it is repeated only when the requirements change.

PYTHON ?= python3
VENV ?= .venv
JOBS ?= 2
PIP_FLAGS ?= -qq
PYTEST_ARGS ?=
BENCH_ARGS ?=
EXAMPLES ?= 100000
NAMES ?=

EXTRAS = bench,rl,rllib,scale,mpc,policies,onnx,view,files,symbolic,foreign,rig,docs,dev
# Windows has its programs elsewhere, with another ending.
BIN = $(VENV)/$(if $(filter Windows_NT,$(OS)),Scripts,bin)
PIP = $(BIN)/pip$(if $(filter Windows_NT,$(OS)),.exe)
CORE = $(VENV)/.core-installed
FULL = $(VENV)/.all-installed
REQUIREMENTS = pyproject.toml constraints.txt
INSTALL = $(BIN)/python -m pip install --disable-pip-version-check $(PIP_FLAGS) -c constraints.txt
EXPLAIN = { echo "make: the installation failed; 'make $(MAKECMDGOALS) PIP_FLAGS=' shows every step of it" >&2; exit 1; }

# A suite starts hundreds of processes; without kept bytecode each compiles every source anew.
unexport PYTHONDONTWRITEBYTECODE

# Its notice about MkDocs 2 is no fault of this project's pages.
export NO_MKDOCS_2_WARNING = 1

.DEFAULT_GOAL := help
.DELETE_ON_ERROR:
.PHONY: help bench peers test test-campaigns examples fuzz test-integrations test-lower-bounds kills lint style types layers
.PHONY: test-browser spelling pages forms docs build release-check archive clean distclean

help: ## Show this list.
	@echo "Targets:"
	@sed -n 's/^\([a-z-]*\):[^#]*## \(.*\)/  make \1|\2/p' Makefile | awk -F'|' '{ printf "%-26s%s\n", $$1, $$2 }'
	@echo "Variables: PYTHON=python3.12, BENCH_ARGS='...', PYTEST_ARGS='-k name', JOBS=2 (tests at once)"

bench: $(CORE) ## Run the benchmark (python -m benchmarks); its report goes to results/.
	$(BIN)/python -m benchmarks $(BENCH_ARGS)

peers: $(CORE) ## Install what the speed is compared with, into .peers/ (some gigabytes).
	$(BIN)/python -m benchmarks.speed.install

test: $(FULL) ## Run the tests and the examples in the docstrings.
	$(BIN)/python -m pytest -n $(JOBS) --dist worksteal -m "not example and not kills and not campaign and not browser" $(PYTEST_ARGS)

test-campaigns: $(FULL) ## Diagnose further hidden effects and rigs, check accuracy further (minutes).
	$(BIN)/python -m pytest -n $(JOBS) --dist worksteal -m campaign tests $(PYTEST_ARGS)

examples: $(FULL) ## Run the examples of README and the pages, and with Ray, PyTorch and SB3.
	$(BIN)/python -m pytest -n $(JOBS) --dist worksteal -m example tests $(PYTEST_ARGS)

test-browser: $(FULL) ## Look at reports and pages in Chromium (apt-get install chromium).
	$(BIN)/python -m pytest -m browser tests/browser $(PYTEST_ARGS)

fuzz: $(FULL) ## Feed the readers hostile files: EXAMPLES inputs each (default 100000; hours).
	PMA_GYM_FUZZ_EXAMPLES=$(EXAMPLES) $(BIN)/python -m pytest -n $(JOBS) --hypothesis-profile search tests/fuzz $(PYTEST_ARGS)

test-integrations: | $(PIP) ## Train shortly with other libraries (.integrations/, NAMES='skrl zoo'; 10 GB).
	$(BIN)/python tests/integrations/run.py $(NAMES)

# The extras of what the project runs with, each requirement at its lower bound, all of them together.
# Old releases announce deprecations of what newer ones of theirs left: those are no fault here.
LOWER = .lower-bounds
LOWER_EXTRAS = bench,rl,rllib,scale,mpc,policies,onnx,view,files,symbolic,rig
LOWER_TESTS = tests/test_requirements.py tests/test_cli.py tests/data tests/codegen \
    tests/integrator tests/plant tests/estimation tests/controllers tests/engine tests/envs tests/sb3

test-lower-bounds: ## Install every lower bound of pyproject.toml into .lower-bounds/ and run tests.
	"$(PYTHON)" -m venv "$(LOWER)"
	"$(PYTHON)" tests/lower_bounds.py constraints > $(LOWER)/constraints.txt
	$(LOWER)/bin/python -m pip install --disable-pip-version-check $(PIP_FLAGS) \
	    -c $(LOWER)/constraints.txt -e '.[$(LOWER_EXTRAS)]' pytest pytest-xdist hypothesis
	$(LOWER)/bin/python tests/lower_bounds.py check
	for command in "pma_gym.cli simulate" "pma_gym.cli diagnose" "benchmarks run"; do \
	    $(LOWER)/bin/python -m $$command --help > /dev/null || exit 1; done
	$(LOWER)/bin/python -m pytest -n $(JOBS) --dist worksteal -W ignore::DeprecationWarning \
	    -W ignore::PendingDeprecationWarning $(LOWER_TESTS) $(PYTEST_ARGS)

KILLS ?= 200

kills: $(FULL) ## Kill long commands at random moments, resume them, count losses (KILLS=200).
	$(BIN)/python -m tests.kills.kill_and_resume --kills $(KILLS)

lint: style spelling types layers pages forms ## Check style, types, layers and documentation (-k: all, whatever fails).

style: $(FULL)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .

# Tests misspell on purpose: messages name the word that was meant.
SPELT = docs README.md CONTRIBUTING.md CHANGELOG.md pma_gym controllers benchmarks

spelling: $(FULL)
	$(BIN)/codespell $(SPELT)
	$(BIN)/python -m pytest -q tests/test_words.py tests/test_pages.py

types: $(FULL)
	$(BIN)/pyright --pythonpath $(BIN)/python

layers: $(FULL)
	$(BIN)/lint-imports

pages: $(FULL)
	$(BIN)/mkdocs build --strict --quiet

FORMS = $(BIN)/check-jsonschema --builtin-schema

forms: $(FULL)
	$(FORMS) vendor.github-workflows .github/workflows/*.yml
	$(FORMS) vendor.github-issue-forms $(filter-out %/config.yml,$(wildcard .github/ISSUE_TEMPLATE/*.yml))
	$(FORMS) vendor.github-issue-config .github/ISSUE_TEMPLATE/config.yml
	$(FORMS) vendor.citation-file-format --force-filetype yaml CITATION.cff

docs: $(FULL) ## Build the documentation into site/.
	$(BIN)/mkdocs build --strict

build: $(FULL) ## Build wheels and sdists of pma-gym and pma-gym-bench into dist/.
	rm -rf dist
	$(BIN)/python -m build --outdir dist . > /dev/null
	$(BIN)/python -m benchmarks.bench_wheel dist
	ls -l dist

# Outside the clone, so that nothing of it can stand in for what a wheel lacks.
RELEASE = $(abspath .release)
RELEASED = $(RELEASE)/$(1)/bin/python -m pip install --disable-pip-version-check $(PIP_FLAGS) -c constraints.txt

OFFERED = from importlib.metadata import metadata; print(*metadata('pma-gym').get_all('Provides-Extra'))

release-check: build ## Install wheels and sdist into clean environments (.release/); run each, resolve every extra.
	rm -rf "$(RELEASE)"
	for each in wheel sdist; do "$(PYTHON)" -m venv "$(RELEASE)/$$each" || exit 1; done
	$(call RELEASED,sdist) dist/pma_gym-*.tar.gz
	$(call RELEASED,wheel) dist/pma_gym-*.whl
	for each in wheel sdist; do \
	    (cd "$(RELEASE)/$$each" && bin/python -m pma_gym.demo && bin/pma-gym --version && \
	    printf 'time_s,motor_voltage_v,regulator_voltage_v\n0,1,5\n2,3,5\n' > ramp.csv && \
	    bin/pma-gym simulate ramp.csv --out trial.csv) || exit 1; done
	for each in $$("$(RELEASE)/wheel/bin/python" -c "$(OFFERED)"); do \
	    $(call RELEASED,wheel) --dry-run --find-links dist "pma-gym[$$each]" || exit 1; done
	$(call RELEASED,wheel) --find-links dist pma-gym-bench
	cd "$(RELEASE)/wheel" && bin/python -c "import pma_gym_controllers, pma_gym_benchmarks" && \
	    bin/pma-gym-bench --controllers pid --task displacement --pressures 300 --jobs 1 --out score

ARCHIVED = benchmarks/suites pma_gym/data/serres2008 docs/figures docs/images docs/results.md \
    docs/leaderboards.md docs/diagnosis-results.md docs/notebook LICENSE CITATION.cff .zenodo.json
DATA = pma-gym-data-$(shell sed -n 's/^version: //p' CITATION.cff)

archive: ## Pack suites, tables and figures for Zenodo, with SHA256SUMS, into dist/ (GNU tar).
	rm -rf build/$(DATA) && mkdir -p build/$(DATA) dist
	git ls-files $(ARCHIVED) | grep -v '[.]py$$' | xargs cp --parents -t build/$(DATA)
	cd build/$(DATA) && find . -type f | sort | xargs sha256sum > ../SHA256SUMS && mv ../SHA256SUMS .
	tar -C build --sort=name --owner=0 --group=0 --mode=u=rwX,go=rX --mtime=@0 -c $(DATA) | gzip -n > dist/$(DATA).tar.gz

clean: ## Remove what the tools generated, but no environment (.venv, .peers...) and not results/.
	rm -rf build dist site *.egg-info .pytest_cache .ruff_cache .hypothesis .import_linter_cache
	find pma_gym controllers benchmarks tests -type d -name __pycache__ -prune -exec rm -rf {} +

distclean: clean ## Remove .venv, .peers, .integrations, .lower-bounds and .release too.
	rm -rf $(VENV) .peers .integrations $(LOWER) "$(RELEASE)"

# pip is the last thing that venv writes, so an interrupted attempt is made again.
$(PIP):
	@command -v "$(PYTHON)" >/dev/null || { \
	    echo "make: '$(PYTHON)' not found; install Python 3.11 or newer," \
	         "or name it: make PYTHON=python3.12" >&2; exit 1; }
	@"$(PYTHON)" -c 'import sys; sys.exit(sys.version_info < (3, 11))' || { \
	    echo "make: pma-gym needs Python 3.11 or newer, '$(PYTHON)' is $$("$(PYTHON)" -V 2>&1);" \
	         "name a newer one: make PYTHON=python3.12" >&2; exit 1; }
	@"$(PYTHON)" -c 'import ensurepip, venv' 2>/dev/null || { \
	    echo "make: '$(PYTHON)' cannot make virtual environments;" \
	         "on Debian or Ubuntu: apt-get install python3-venv" >&2; exit 1; }
	@echo "Making $(VENV) with $$("$(PYTHON)" -V)"
	@"$(PYTHON)" -m venv "$(VENV)"

$(CORE): $(REQUIREMENTS) | $(PIP)
	@echo "Installing the core into $(VENV) (about a minute)"
	@$(INSTALL) -e '.[bench,mpc,policies]' || $(EXPLAIN)
	@touch $@

$(FULL): $(REQUIREMENTS) | $(CORE)
	@echo "Installing PyTorch into $(VENV)"
	@$(INSTALL) torch || $(EXPLAIN)
	@echo "Installing the other extras and the tools of development into $(VENV) (some minutes)"
	@$(INSTALL) -e '.[$(EXTRAS)]' || $(EXPLAIN)
	@touch $@
