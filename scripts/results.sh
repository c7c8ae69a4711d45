#!/usr/bin/env bash
# Measures the tables that docs/results archives, and has their pages written again.
# usage: results.sh UMBRAVOX [FOLDER...]    UMBRAVOX: the program; FOLDER: such as near-rays/engine-ct, near-rays, chest;
# without folders, all but the benchmark, which takes hours: name it.
# Scans are found in UMBRAVOX_DATA (../shared/data). Times are those of this machine: let nothing else run.
set -euo pipefail
program=$(realpath "$1")
shift
cd "$(dirname "$0")/.."
root=$PWD
data=$(realpath "${UMBRAVOX_DATA:-../shared/data}")
[[ -e $data/engine.nii.gz ]] || { echo "results.sh: no scans in $data: set UMBRAVOX_DATA (data/README.md)" >&2; exit 2; }
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
# Commands run where scans and functions lie, so that the archives have no absolute paths.
ln -s "$data"/*.nii.gz "$root"/docs/results/functions/*.json "$root/examples"/{chest.toml,external_vtk.py} "$work"
mkdir "$work/bin" && ln -s "$program" "$work/bin/umbravox"
export PATH=$work/bin:$PATH
chosen=("$@")
measured=0

# Whether a folder was asked for: by its name, by that of a folder around it, or as one of all.
is_chosen() {
    local folder=$1 name
    [[ ${#chosen[@]} -gt 0 ]] || { [[ $folder != benchmark/* ]] && return; return 1; }
    for name in "${chosen[@]}"; do [[ $folder == "$name" || $folder == "$name"/* ]] && return; done
    return 1
}

# archive FOLDER ARGUMENT...: runs the program, and keeps the table with what `umbravox verify` needs.
archive() {
    local folder=$1 name file
    shift
    is_chosen "$folder" || return 0
    measured=$((measured + 1))
    name=$(basename "$folder")
    echo "$folder"
    (cd "$work" && umbravox "$@" -o "$name" >"$name.log" 2>&1) || { cat "$work/$name.log" >&2; exit 1; }
    # The archive is replaced as a whole, once all of its files are copied.
    mkdir "$work/archived"
    (
        shopt -s nullglob
        cd "$work/$name"
        for file in {run.json,compare.csv,{,*_}scene.toml,{,*_}transfer_function.json,{benchmark,claims,stability}.{csv,md},ranking.csv,ranks_*.png,cells}; do
            [[ ! -e $file ]] || cp -r "$file" "$work/archived/"
        done
    )
    rm -rf "docs/results/$folder" && mkdir -p "docs/results/$(dirname "$folder")"
    mv "$work/archived" "docs/results/$folder"
    rm -rf "${work:?}/$name"
}

readonly light=(--light dir:0.5,-0.5,0.7071)

papers="dsm:map=256,segments=transmittance,march=samples,filter=nearest,near=0,lookup=each;osm:map=256,kernel=3,filter=nearest,near=0,average=depth,lookup=each;dom:map=256,layers=3,near=0,average=depth,lookup=each;bom:map=256,layers=16,split=auto,depth_bits=32,bits=32,near=0,average=depth,lookup=each"
archive chest/table compare --scene chest.toml --repeats 7 --methods "none;rays;rays:march=samples,step=1;dsm:map=256,epsilon=0.06,0.02,0.005;osm:map=256,layers=8,32,128;dom:map=256,layers=7,31;bom:map=256,layers=7,31;clusters:map=256,clusters=4,8;fourier:map=256,terms=7,15;wavelet:map=256,rank=4;avsm:map=256,nodes=8,16;moments:map=256,moments=6,8;beer:map=256;lightvolume:scale=4,2;sat:boxes=16,64;halfangle;$papers"

near="dsm:epsilon=0.005,map=128,256,near=0,2,4,8;dsm:epsilon=0.005,map=256,near=0,4,align=on;avsm:map=256,near=0,4;clusters:map=256,near=0,4;bom:map=256,near=0,4;osm:map=256,near=0,4;moments:map=256,near=0,4"
enclosures="dsm:fit=volume,epsilon=0.005,map=256,enclose=on,near=0,2,4,8;dsm:fit=volume,epsilon=0.005,map=512,enclose=on,near=4"
# scene NAME VOLUME...: the tables that have a row or a column for each scene.
scene() {
    local name=$1
    shift
    archive "near-rays/$name" compare "$@" "${light[@]}" --methods "$near" --size 256x256 --step 1 --rays 200
    archive "enclosures/$name" compare "$@" "${light[@]}" --methods "$enclosures" --size 64x48 --points 4000 --rays 1000 --repeats 1
}
scene engine-ct engine.nii.gz --tf ct
scene engine-isosurface engine.nii.gz --tf isosurface
scene vessels CT_AVM.nii.gz --tf vessels
scene vessels-isosurface CT_AVM.nii.gz --tf isosurface
scene head CT_pitch.nii.gz --tf ct
scene thorax phantom:thorax:128 --tf ct
scene hair phantom:hair-curly --tf hair
archive near-rays/curves compare engine.nii.gz --tf engine.json "${light[@]}" --methods "dsm:epsilon=0.002,map=256,near=0,4,align=off,on;avsm:nodes=32,bits=32,map=256,near=0,4,align=off,on" --size 256x256 --step 1 --rays 200

optimal="dsm:epsilon=0.005,0.02,0.06;dsm:epsilon=0.005,0.02,0.06,segments=transmittance;dsm:epsilon=0.005,0.02,0.06,compress=optimal"
archive optimal-nodes/engine compare engine.nii.gz --tf engine.json --methods "$optimal" --rays 500
archive optimal-nodes/vessels compare CT_AVM.nii.gz --tf vessels --methods "$optimal" --rays 500

for step in 1 0.5 0.25; do
    archive "shadow-errors/step-$step" compare engine.nii.gz --tf engine.json "${light[@]}" --size 256x256 --step "$step" --methods "none;rays;dsm:epsilon=0.02,map=256;osm:map=256;rays:lookup=each;dsm:map=256,lookup=each"
done

# The error that pictures by shadow rays keep at small steps is that of eye rays: a picture of ambient light alone has it too.
archive shadow-errors/step-0.0625 compare engine.nii.gz --tf engine.json "${light[@]}" --size 256x256 --step 0.0625 --repeats 1 --methods "rays;rays:lookup=each"
archive shadow-errors/ambient compare engine.nii.gz --tf engine.json "${light[@]}" --ambient 1 --size 256x256 --step 0.0625 --repeats 1 --methods none
archive shadow-errors/flicker compare engine.nii.gz --tf engine.json "${light[@]}" --size 256x256 --step 1 --zoom 3 --flicker 64 --repeats 1 --rays 50 --points 4000 --methods "dsm:map=256,fit=view,volume;osm:map=256,fit=view,volume;bom:map=256,fit=view,volume;moments:map=256,fit=view,volume;lightvolume:scale=2"

archive strands/hair-curly compare phantom:hair-curly:1500000 --resolution 128 --light dir:0.5,0.6,0.6 --size 256x256 --step 1 --repeats 3 --points 4000 --methods "dsm:epsilon=0.02,map=64,128,192,from=voxels,lines;osm:layers=32,map=64,128,192,from=voxels,lines;dom:layers=15,map=64,128,192,from=voxels,lines;bom:layers=15,map=64,128,192,from=voxels,lines;clusters:clusters=8,map=64,128,192,from=voxels,lines;fourier:terms=7,range=texel,map=64,128,192,from=voxels,lines;avsm:nodes=16,map=64,128,192,from=voxels,lines;moments:moments=6,map=64,128,192,from=voxels,lines"

soft="rays;dsm:map=256,epsilon=0.02;osm:map=256,layers=32;dom:map=256,layers=15;bom:map=256,layers=15;clusters:map=256,clusters=8;fourier:map=256,terms=7;wavelet:map=256,rank=4;avsm:map=256,nodes=16;moments:map=256,moments=6;beer:map=256;lightvolume:scale=2;sat:scale=1,boxes=16;sat:scale=1,boxes=16,angle=0"
sun=(--light "sun:0.5,-0.5,0.7071,angle=15" --size 96x96 --step 1 --points 1000 --rays 1 --depths 5 --repeats 1)
archive soft-light/thorax-sun compare phantom:thorax:64 --tf ct "${sun[@]}" --methods "$soft"
archive soft-light/engine-sun compare engine.nii.gz --tf ct "${sun[@]}" --methods "$soft"
# The scenes of pictures.png.
scenes=()
for source in sky sun:0.5,-0.5,0.7071,angle=5 disc:0,-150,200,radius=60; do
    while read -r volume file function; do
        scene=$volume-${source%%:*}
        printf 'volume = "%s"\ntf = "%s"\nlight = "%s"\n' "$file" "$function" "$source" >"$work/$scene.toml"
        scenes+=(--scene "$scene.toml")
    done <<'END'
chest phantom:thorax:96 ct
engine engine.nii.gz engine.json
END
done
archive soft-light/pictures compare "${scenes[@]}" --ambient 0 --size 64x64 --points 1000 --rays 1 --depths 5 --repeats 1 --methods "rays;dsm:epsilon=0.02;sat:scale=1,boxes=16"

random="rays;rays:march=samples,step=0.5,1,2,4;rays:estimator=ratio,residual,samples=1,4,16;rays:estimator=jackknife,samples=8,32,128;rays:estimator=unbiased,samples=4,16,64"
archive random-rays/cloud compare phantom:cloud:128 --tf cloud.json "${light[@]}" --size 128x128 --step 1 --points 4000 --rays 50 --methods "$random"
archive random-rays/engine compare engine.nii.gz --tf engine.json "${light[@]}" --size 128x128 --step 1 --points 4000 --rays 50 --methods "$random"

scenes=()
for volume in cloud smoke foam struts sheets; do
    for function in thin step; do
        scene=$volume-$function.toml
        printf 'volume = "phantom:%s:64"\ntf = "%s.json"\n' "$volume" "$function" >"$work/$scene"
        scenes+=(--scene "$scene")
    done
done
for points in 20000 1000000; do
    archive "intervals/points-$points" compare "${scenes[@]}" "${light[@]}" --size 64x64 --points "$points" --rays 5 --depths 5 --repeats 1 --methods "none;rays:march=samples,step=2;dsm:map=64,128;osm:map=64,128;dom:map=64,128;bom:map=64,128;clusters:map=64,128;fourier:map=64,128;avsm:map=64,128;moments:map=64,128;lightvolume:scale=2,4"
done

# The error bound on all light rays of a map, and at points between them.
scenes=()
while read -r volume file ramp_start ramp_end step; do
    echo "{\"name\": \"ramp\", \"points\": [{\"value\": $ramp_start, \"opacity\": 0}, {\"value\": $ramp_end, \"opacity\": 0.6}]}" >"$work/$volume-ramp.json"
    echo "{\"name\": \"step\", \"points\": [{\"value\": $step, \"extinction\": 0}, {\"value\": $step, \"extinction\": 1}]}" >"$work/$volume-step.json"
    for function in "$volume-ramp.json" "$volume-step.json" isosurface; do
        scene=$volume-$(basename "${function#"$volume-"}" .json)
        printf 'name = "%s"\nvolume = "%s"\ntf = "%s"\n' "$scene" "$file" "$function" >"$work/$scene.toml"
        scenes+=(--scene "$scene.toml")
    done
done <<'END'
engine engine.nii.gz 60 120 100
vessels CT_AVM.nii.gz 150 400 250
head CT_pitch.nii.gz 60 180 120
END
archive error-bound/texels compare "${scenes[@]}" "${light[@]}" --methods "dsm:map=192,epsilon=0.06,0.02,0.005" --check all --depths 40 --size 64x48 --points 1000 --repeats 1
scenes=()
while read -r scene volume function; do
    printf 'name = "%s"\nvolume = "%s"\ntf = "%s"\n' "$scene" "$volume" "$function" >"$work/$scene.toml"
    scenes+=(--scene "$scene.toml")
done <<'END'
engine-ct engine.nii.gz ct
engine-isosurface engine.nii.gz isosurface
vessels CT_AVM.nii.gz vessels
vessels-isosurface CT_AVM.nii.gz isosurface
head CT_pitch.nii.gz ct
thorax phantom:thorax:128 ct
hair phantom:hair-curly hair
END
archive error-bound/points compare "${scenes[@]}" "${light[@]}" --methods "dsm:fit=volume,epsilon=0.005,map=256,enclose=on;rays" --check points --size 64x48 --points 1000 --repeats 1

archive claims/run claims
archive stability/llvmpipe stability --adapter llvmpipe
# A second compiler, where chromium is.
swiftshader=/usr/lib/chromium/vk_swiftshader_icd.json
[[ ! -e $swiftshader ]] || VK_DRIVER_FILES=$swiftshader archive stability/swiftshader stability

# Needs a python3 with vtk, nibabel, numpy and OpenEXR.
vtk="xvfb-run -a python3 external_vtk.py"
vtk_cells=(cloud-{thin,dense}-front-front cloud-dense-lamp-front foam-thin-side-close foam-dense-side-front engine-dense-side-front vessels-dense-back-front)
# Pictures by exact shadow rays have the errors of eye rays alone. Their scenes are those of the archived cells.
scenes=()
for cell in "${vtk_cells[@]}"; do
    is_chosen benchmark/eye-rays-step-1 || is_chosen benchmark/eye-rays-step-0.5 || break
    python3 - "docs/results/benchmark/vtk/cells/$cell.json" "$work/$cell" <<'END'
import json, sys
cell, name = json.load(open(sys.argv[1])), sys.argv[2]
open(f"{name}.json", "w").write(cell["transfer_function"])
open(f"{name}.toml", "w").write(cell["scene"].replace("function.json", f"{cell['cell']}.json"))
END
    scenes+=(--scene "$cell.toml")
done
for step in 1 0.5; do
    archive "benchmark/eye-rays-step-$step" compare "${scenes[@]}" --step "$step" --methods rays --repeats 1 --rays 50 --points 1000
done
archive benchmark/vtk benchmark --data . --cells "$(IFS=,; echo "${vtk_cells[*]}")" --methods dsm,osm --budget bytes=512KiB --external "vtk=$vtk" --external "vtk-half-step=VTK_STEP_VOXELS=0.5 $vtk"
archive benchmark/all benchmark --data . --cells "*-front-*,*-side-*,*-back-*,*-lamp-*"
# Their searches start from the settings of cells in the first folder, which are read there and not searched again.
for source in sun sky; do
    archive "benchmark/$source" benchmark --data . --cells "*-$source-front" --settings "$root/docs/results/benchmark/all"
done
archive benchmark/time benchmark --data . --cells "*-dense-front-front" --budget frames=4

# Settings that cost no memory, at twice the ends of their lists.
if is_chosen benchmark/doubled; then
    mkdir -p "$work/settings/cells"
    cp docs/results/benchmark/all/run.json "$work/settings/"
    for cell in docs/results/benchmark/all/cells/*-front-front.json; do
        sed -E '/"settings"/ { s/\bnear=8\b/near=16/; s/\bslices=256\b/slices=512/; s/\bboxes=64\b/boxes=128/; s/\biterations=4\b/iterations=8/ }' \
            "$cell" >"$work/settings/cells/${cell##*/}"
    done
fi
archive benchmark/doubled benchmark --data . --cells "*-front-front" --settings settings

[[ $measured -gt 0 ]] || { echo "results.sh: no folder ${chosen[*]}" >&2; exit 2; }
UMBRAVOX_REWRITE=1 cargo test --locked --test it tables_of_the_pages
