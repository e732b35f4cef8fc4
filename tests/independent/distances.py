"""Distances between two meshes as point-cloud-utils measures them: nothing here is the project's own.

Reads {"first": mesh, "second": mesh, "samples": n} from standard input, a mesh being {"positions": [[x, y, z], …],
"triangles": [[a, b, c], …]}; writes RMS, largest distance and mean angle between normals, both ways, to standard output.
"""

import json
import sys

import numpy as np
import point_cloud_utils as pcu


def normals(positions, triangles):
    a, b, c = (positions[triangles[:, k]] for k in range(3))
    normal = np.cross(b - a, c - a)
    return normal / np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-300)


def one_way(source, target, samples, seed):
    (v, f), (w, g) = source, target
    faces, weights = pcu.sample_mesh_random(v, f, num_samples=samples, random_seed=seed)
    points = pcu.interpolate_barycentric_coords(f, faces, weights, v)
    distance, nearest, _ = pcu.closest_points_on_mesh(points, w, g)
    # A vertex that no triangle has is no part of the surface.
    at_vertices, _, _ = pcu.closest_points_on_mesh(v[np.unique(f)], w, g)
    cosine = np.sum(normals(v, f)[faces] * normals(w, g)[nearest], axis=1)
    return {
        "rms": float(np.sqrt(np.mean(distance**2))),
        "max": float(max(distance.max(), at_vertices.max())),
        "angle": float(np.degrees(np.arccos(np.clip(cosine, -1, 1))).mean()),
    }


def main():
    task = json.load(sys.stdin)
    first, second = (
        (np.array(task[name]["positions"], dtype=np.float64), np.array(task[name]["triangles"], dtype=np.int64))
        for name in ("first", "second")
    )
    samples = task["samples"]
    json.dump(
        {"forward": one_way(first, second, samples, 11), "backward": one_way(second, first, samples, 12)}, sys.stdout
    )


main()
