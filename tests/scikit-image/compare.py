#!/usr/bin/env python3
"""Measures the pictures beside this file with scikit-image, and writes figures.csv.

    pip install scikit-image imageio
    tests/scikit-image/compare.py
"""

import csv
from pathlib import Path

import numpy as np
from imageio.v3 import imread
from skimage.metrics import peak_signal_noise_ratio, structural_similarity

HERE = Path(__file__).resolve().parent


def luma(picture):
    return picture @ np.array([0.299, 0.587, 0.114])


def ssim(a, b):
    # The parameters by which scikit-image's documentation matches Wang et al. 2004.
    return structural_similarity(
        luma(a), luma(b), gaussian_weights=True, sigma=1.5, use_sample_covariance=False, data_range=1.0, K1=0.01, K2=0.03
    )


def read(name):
    return imread(HERE / f"{name}.png")[..., :3].astype(np.float64) / 255.0


rows = [("reference", "picture", "psnr", "ssim within")]
for scene in ("cornell", "chains"):
    reference = read(f"{scene}-converged")
    for graph in ("epi", "render-cache"):
        picture = read(f"{scene}-{graph}")
        psnr = peak_signal_noise_ratio(reference, picture, data_range=1.0)
        rows.append((f"{scene}-converged", f"{scene}-{graph}", f"{psnr:.9f}", f"{ssim(reference, picture):.9f}"))
with open(HERE / "figures.csv", "w", newline="") as file:
    csv.writer(file, lineterminator="\n").writerows(rows)
