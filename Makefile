# make demo    build, then compare the shadow methods on the built-in chest phantom
# make quick   the library's unit tests and the tests without a device: for the inner loop
# make test    every test, the slow ones at a small size, those of the Python module too; UMBRAVOX_TESTS=full for full size
# make python  the Python module: its wheel is built, installed into a fresh virtual environment and tested
# make adapters   the tests that depend on a driver, and the stability suite, on every software Vulkan that is there
# make lint    formatting and clippy, as CI runs them
# make bench   the criterion benches, and what shadows cost at which error (in turn with UMBRAVOX_BEFORE, another binary, and
#              UMBRAVOX_PEER, a command that runs VTK's ray caster)
# make shots   screenshots of the window and its frame times in out/shots, under Xvfb on CT_AVM (SHOTS_VOLUME names another);
#              those of docs/window.md are made anew
# make sizes   screenshots of the window in out/sizes, from 640 x 480 to 1920 x 1080 points at the scales 1 and 2
# make measured   measures the tables of docs/results/adapters on this adapter, into ADAPTER.md there (MEASURED_FLAGS="--only cost")
# make results    measures the archived tables of docs/results again and writes their pages, on a quiet machine (RESULTS=near-rays
#              for some of them)
# make pictures   every picture of README and docs but the window's, anew (PICTURES_EFFORT="--repeats 1 --points 1000 --rays 100"
#              is a trial)
# make book    the documentation as a website with search, in out/book/html; needs mdBook (MDBOOK names the program)
# make check-tools   what is missing to build and run; installs nothing

CARGO ?= cargo
TARGET_DIR := $(or $(CARGO_TARGET_DIR),target)
UMBRAVOX := $(TARGET_DIR)/release/umbravox
WINDOW_SHOTS := $(TARGET_DIR)/release/examples/window_shots
DEMO_DIR ?= out/demo
DEMO_FLAGS ?= phantom:thorax:64 --size 192x192 --repeats 2

UMBRAVOX_DATA ?= ../shared/data
SHOTS_VOLUME ?= $(UMBRAVOX_DATA)/CT_AVM.nii.gz
GRID_METHODS := none;rays;dsm:map=256,epsilon=0.02;osm:map=256,layers=32;fourier:map=256,terms=15
PAGE_METHODS := dsm;rays;avsm;osm
PICTURES_EFFORT ?= --repeats 7
PICTURES_DIR ?= docs
MDBOOK ?= mdbook
XVFB := xvfb-run -a -s "-screen 0 1600x1000x24"
XVFB_LARGE := xvfb-run -a -s "-screen 0 3840x2160x24"
SIZES ?= 640x480@1 900x560@1 900x560@2 1280x720@1 1280x720@2 1920x1080@1 1920x1080@2

.PHONY: demo quick test python adapters lint mpi bench shots sizes measured results pictures book setup check-tools

demo: setup
	$(CARGO) build --release --locked
	$(UMBRAVOX) compare $(DEMO_FLAGS) -o $(DEMO_DIR)
	@echo
	@echo "table:    $(DEMO_DIR)/compare.md (also .csv, .json, .tex)"
	@echo "plots:    $(DEMO_DIR)/compare.svg and compare_bytes.svg (also .png)"
	@echo "report:   $(DEMO_DIR)/report.html, all of this in one file"
	@echo "pictures: $(DEMO_DIR)/picture_*.png, differences from rays: $(DEMO_DIR)/difference_*.png"

quick: setup
	CARGO="$(CARGO)" scripts/test.sh quick

test: setup
	CARGO="$(CARGO)" scripts/test.sh

python: setup
	CARGO="$(CARGO)" UMBRAVOX_TESTS=full scripts/python.sh

adapters:
	@scripts/setup.sh --tests
	CARGO="$(CARGO)" scripts/adapters.sh

lint:
	$(CARGO) fmt --check
	$(CARGO) fmt --check --manifest-path python/Cargo.toml
	$(CARGO) fmt --check --manifest-path mpi/Cargo.toml
	$(CARGO) clippy --locked --all-targets -- -D warnings
	$(CARGO) clippy --locked -p umbravox-python -- -D warnings

# Needs an MPI library and libclang: docs/cluster.md.
mpi:
	$(CARGO) clippy --locked -p umbravox-mpi --all-targets -- -D warnings
	$(CARGO) test --locked -p umbravox-mpi

bench: setup
	$(CARGO) bench --locked

shots:
	@scripts/setup.sh --window
	$(CARGO) build --release --locked --example window_shots
	@mkdir -p out/shots
	$(XVFB) $(WINDOW_SHOTS) scripts/shots.txt $(SHOTS_VOLUME) --tf vessels --clean
	@rm -rf out/shots/comparison
	$(XVFB) $(WINDOW_SHOTS) scripts/parts.txt phantom:thorax:64 --tf bone --clean
	@cp out/shots/window-*.png docs/
	$(XVFB) $(WINDOW_SHOTS) scripts/drags.txt $(SHOTS_VOLUME) --tf vessels --clean
	$(XVFB) $(WINDOW_SHOTS) scripts/resizes.txt $(SHOTS_VOLUME) --tf vessels --shadow rays --clean
	@echo && cat out/shots/drags.tsv

sizes:
	@scripts/setup.sh --window
	$(CARGO) build --release --locked --example window_shots
	@mkdir -p out/sizes
	@for size in $(SIZES); do \
		points=$${size%@*} scale=$${size#*@}; \
		sed "s/WIDTH/$${points%x*}/g; s/HEIGHT/$${points#*x}/g; s/SCALE/$$scale/g" scripts/sizes.txt >out/sizes/script.txt; \
		WINIT_X11_SCALE_FACTOR=$$scale $(XVFB_LARGE) $(WINDOW_SHOTS) out/sizes/script.txt \
			phantom:thorax:64 --tf bone --clean || exit 1; \
	done

measured: setup
	$(CARGO) build --release --locked
	UMBRAVOX_DATA="$(UMBRAVOX_DATA)" scripts/measured.py $(UMBRAVOX) $(MEASURED_FLAGS)

results: setup
	$(CARGO) build --release --locked
	UMBRAVOX_DATA="$(UMBRAVOX_DATA)" scripts/results.sh $(UMBRAVOX) $(RESULTS)

pictures: setup
	$(CARGO) build --release --locked
	$(CARGO) build --release --locked --example strip
	@mkdir -p $(PICTURES_DIR)
	$(TARGET_DIR)/release/examples/strip examples/chest.toml docs/results/chest/table/compare.csv $(PICTURES_DIR)/strip.png
	$(UMBRAVOX) compare --scene examples/chest.toml --methods "$(GRID_METHODS)" $(PICTURES_EFFORT) --overwrite -o out/grid
	cp out/grid/grid.png $(PICTURES_DIR)/grid.png
	$(UMBRAVOX) render --scene examples/chest.toml --size 220x220 --light-sweep 24 --fps 8 -o $(PICTURES_DIR)/sweep.gif
	$(UMBRAVOX) export phantom:thorax:128 --methods "$(PAGE_METHODS)" --size 400 -o out/page.html
	scripts/page_shot.py out/page.html $(PICTURES_DIR)/page.png 860x1010

book:
	scripts/book.py --mdbook "$(MDBOOK)"

setup:
	@scripts/setup.sh

check-tools:
	@scripts/setup.sh --check && echo "nothing is missing"
