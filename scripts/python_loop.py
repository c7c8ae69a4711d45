#!/usr/bin/env python3
"""Compares a loop of pictures through the Python module with the same loop through the library, in turn (A B A B).

usage: python_loop.py target/release/examples/render_loop [VOLUME METHOD SIZE COUNT ROUNDS]
Build that by `cargo build --release --example render_loop`; the module must be installed (`pip install .`).
"""

import statistics
import subprocess
import sys
import time

import numpy as np

import umbravox as uv


def loop(scene, count):
    camera = scene.camera()
    eye, target = np.array(camera["eye"]), np.array(camera["target"])
    away = eye - target
    scene.render()
    start, total = time.perf_counter(), 0.0
    for k in range(count):
        turn = 2 * np.pi * k / count
        c, s = np.cos(turn), np.sin(turn)
        moved = np.array([c * away[0] - s * away[1], s * away[0] + c * away[1], away[2]])
        total += scene.render(eye=target + moved, target=target).mean(dtype=np.float64)
    return 1e3 * (time.perf_counter() - start) / count, total


def main():
    program, given = sys.argv[1], sys.argv[2:]
    volume, method, size, count, rounds = given + ["phantom:thorax:128", "dsm:fit=volume,map=256", "256", "100", "5"][len(given) :]
    scene = uv.Scene(volume, shadow=method, size=(int(size), int(size)))
    ours, theirs = [], []
    for _ in range(int(rounds)):
        line = subprocess.run([program, volume, method, size, count], capture_output=True, text=True, check=True).stdout
        theirs.append(float(line.split()[0]))
        ours.append(loop(scene, int(count))[0])
        print(f"library {theirs[-1]:.3f} ms a picture, Python {ours[-1]:.3f}", flush=True)
    a, b = statistics.median(theirs), statistics.median(ours)
    print(f"medians of {rounds}: library {a:.3f}, Python {b:.3f} ms, ratio {b / a:.3f} ({scene.last['adapter']}, {volume}, {method}, {size} x {size}, {count} pictures)")


if __name__ == "__main__":
    main()
