# Each target sets up what it needs in .venv. Only Python 3.11 or newer, pip and make are required.
# To use another Python: make PYTHON=python3.12 test (first remove a .venv made with a different one).

# Many tests start processes. Without bytecode, each would compile everything that it imports.
unexport PYTHONDONTWRITEBYTECODE

PYTHON ?= python3
VENV   := .venv
BIN    := $(VENV)/bin
READY  := $(VENV)/ready

# The bench targets write one line of JSON per case into RESULTS; bench-docs generates the tables of docs/speed.md from them.
RESULTS := benchmarks/results
PEERS   := .venv-peers

.DEFAULT_GOAL := help
.PHONY: help demo follow studio photographs test test-fast lint bench peers bench-peers bench-goals bench-docs bench-links bench-ros bench-studio docs docs-nodes docs-drawings docs-mermaid docs-studio web test-web soak setup clean

help:
	@echo "make demo    a robot fetches and delivers cubes; score, video and report in out/fetch_delivery, in less than 3 minutes"
	@echo "make follow  a robot follows a person outdoors; report with map in out/follow_person, in a few minutes"
	@echo "make studio  the delivery robot live in the studio: watch it in the browser, steer it, let things go wrong"
	@echo "make photographs   search, measure and report on real photographs, watched and controlled"
	@echo "make test    run all tests (without the long ones)"
	@echo "make test-fast   run those that take no time, in half a minute"
	@echo "make lint    ruff, mypy and the check of our English"
	@echo "make bench   run the benchmarks (bench-peers: with other libraries; bench-docs: write docs/speed.md;"
	@echo "             bench-goals: the goals, and whether they are reached; bench-links: between processes; bench-ros: ROS 2; bench-studio: the page)"
	@echo "make docs    build the documentation as a site in build/site"
	@echo "make docs-nodes   write docs/nodes from the docstrings of the library"
	@echo "make docs-drawings   redraw the graphs in README and docs"
	@echo "make docs-mermaid   draw the Mermaid diagrams in docs for the site; needs Chromium and npm"
	@echo "make docs-studio    take the pictures of the studio in docs from the page; needs Chromium"
	@echo "make web     build the page of the studio into hfg/studio/static; needs Node 20 and npm"
	@echo "make test-web   check the page of the studio alone: types and unit tests; needs Node 20 and npm"
	@echo "make soak    run the tests that take minutes"
	@echo "make clean   remove .venv and everything that tools have left"

# On a slow machine it ends earlier, and reports what there is by then.
demo: $(READY)
	$(BIN)/python -m examples.fetch_delivery --minutes 2 --within 120 --report out/fetch_delivery $(ARGS)

follow: $(READY)
	$(BIN)/python -m examples.follow_person --metres 300 --within 240 --report out/follow_person

# In real time, until Ctrl-C. Without a browser it prints the address.
studio: $(READY)
	$(BIN)/python -m hfg studio examples.fetch_delivery.mission:build --arg robots=2 --inside robot_0 --run

photographs: $(READY)
	$(BIN)/python examples/photographs.py

# Uses one process per core; with a single process: .venv/bin/python -m pytest
test: $(READY)
	$(BIN)/python -m pytest --numprocesses auto --dist worksteal

# The tests that are not marked slow, and of each the first cases only: before each commit.
test-fast: $(READY)
	$(BIN)/python -m pytest -q --fast --numprocesses auto --dist worksteal

lint: $(READY)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/python tools/prose.py --ratchet

bench: $(READY)
	$(BIN)/python -m benchmarks --json $(RESULTS)

# The other libraries have an environment of their own, because hfg does not need them. If one cannot be installed, it is reported and skipped.
peers: $(READY)
	@test -x $(PEERS)/bin/python || "$(PYTHON)" -m venv $(PEERS)
	$(PEERS)/bin/python -m pip install --quiet --disable-pip-version-check --editable '.[examples,ros2]'
	@grep -v '^#' benchmarks/peers/requirements.txt | while read -r peer; do \
	  $(PEERS)/bin/python -m pip install --quiet --disable-pip-version-check "$$peer" || echo "skipped: $$peer" >&2; done

bench-peers: peers
	$(PEERS)/bin/python -m benchmarks bench_peers --json $(RESULTS)
	$(PEERS)/bin/python -m benchmarks.profile_hop --json $(RESULTS)

# AGAINST=DIR, another checkout of hfg, adds comparisons with it.
bench-goals: peers
	$(PEERS)/bin/python -m benchmarks bench_goals --json $(RESULTS) $(if $(AGAINST),--against "$(AGAINST)")

bench-links: peers
	$(PEERS)/bin/python -m benchmarks bench_links --json $(RESULTS)

bench-ros: peers
	$(PEERS)/bin/python -m benchmarks bench_ros --json $(RESULTS)

# Needs Chromium.
bench-studio: $(READY)
	$(BIN)/python -m benchmarks bench_studio --json $(RESULTS)

bench-docs: $(READY)
	$(BIN)/python -m benchmarks.page $(RESULTS)

# The site has tools of its own, which nothing else needs.
docs: $(READY)
	@$(BIN)/python -c 'import zensical, mkdocstrings' 2>/dev/null || \
	  $(BIN)/python -m pip install --quiet --disable-pip-version-check --editable '.[docs]'
	$(BIN)/python tools/build_docs.py

docs-mermaid: $(READY)
	$(BIN)/python -m tools.draw_mermaid

docs-studio: $(READY)
	$(BIN)/python -m tools.draw_studio

docs-drawings: $(READY)
	HFG_REDRAW=1 $(BIN)/python -m pytest -q tests/test_drawings.py

docs-nodes: $(READY)
	$(BIN)/python -m tools.write_node_pages docs/nodes

# The built page is committed, so that nobody needs Node to use the studio. Scripts of packages are not run.
web/node_modules: web/package.json web/package-lock.json
	cd web && npm ci --ignore-scripts --no-fund --no-audit
	@touch $@

web: web/node_modules
	cd web && npm run build

test-web: web/node_modules
	cd web && npm test

soak: $(READY)
	$(BIN)/python -m pytest -m soak --timeout 3600

setup: $(READY)

clean:
	rm -rf $(VENV) $(PEERS) build dist .mypy_cache .pytest_cache .ruff_cache .hypothesis
	find . -name __pycache__ -type d -prune -exec rm -rf {} +

# Made once, and again when pyproject.toml is newer. The old one is removed first, so that an interrupted set-up never looks complete.
$(READY): pyproject.toml
	@command -v "$(PYTHON)" >/dev/null 2>&1 || { \
	  echo "hfg needs Python 3.11 or newer, but there is no '$(PYTHON)' here; name yours: make PYTHON=/path/to/python3" >&2; exit 1; }
	@"$(PYTHON)" -c 'import sys; sys.exit(sys.version_info < (3, 11))' || { \
	  echo "hfg needs Python 3.11 or newer, but '$(PYTHON)' is $$("$(PYTHON)" --version 2>&1); name a newer one: make PYTHON=python3.12" >&2; exit 1; }
	@"$(PYTHON)" -c 'import ensurepip, venv' 2>/dev/null || { \
	  echo "'$(PYTHON)' cannot make virtual environments, its modules venv or ensurepip are missing; install them (on Debian and Ubuntu the package python3-venv)" >&2; exit 1; }
	rm -rf $(VENV)
	"$(PYTHON)" -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable '.[test,examples]'
	@touch $@
