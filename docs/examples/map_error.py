"""The error of a map, by the commands as functions: map_error.png."""

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import tileflight as tf

if not Path("place").exists():
    tf.make_stadium("place")

FIELD = (35.310344, -80.740007, 190)
tf.Camera.fisheye(640, 360, fov_deg=120).write("camera.yaml")
Path("short-flight.yaml").write_text("""\
camera: camera.yaml
fps: 5
speed_m_s: 3.6
acceleration_m_s2: 1.5
yaw_rate_deg_s: 15
waypoints:
  - {position: [-2, -80, 27], yaw_deg: 3, pitch_deg: -38}
  - {position: [5, -36, 24], yaw_deg: -3, pitch_deg: -37}
  - {position: [12, 9, 23], yaw_deg: -13, pitch_deg: -36}
""")

# Each function is the command of the same name: it writes the same files and returns the JSON of --json.
tf.extract("place/twin", center=FIELD, size=(250, 250, 120), origin=FIELD, out="truth", force=True)
tf.render("place/twin", flight="short-flight.yaml", origin=FIELD, out="dataset", force=True)
tf.odometry("dataset", out="odometry", force=True)
tf.align("odometry", to="truth", dataset="dataset", out="transform.json", force=True)
metrics = tf.evaluate(
    "odometry", truth="truth", transform="transform.json", dataset="dataset", out="metrics.json", force=True
)
for warning in metrics["warnings"]:
    print(f"{warning['severity']}: {warning['message']}")
surface = metrics["surface"]
print(f"median distance to the surface: {surface['median']:.3f} m")

# Half of the points lie within the median; the floor bounds the published measure from below.
figure, (histogram, curves) = plt.subplots(1, 2, figsize=(11, 4.2), layout="constrained")
edges = np.array(metrics["map"]["histogram"]["edges"])
histogram.stairs(metrics["map"]["histogram"]["counts"], edges, fill=True, color="0.75")
histogram.axvline(metrics["map"]["mean"], color="tab:red", label=f"mean, {metrics['map']['mean']:.3f} m")
floor = metrics["map"]["quantization_floor"]["mean"]
histogram.axvline(floor, color="tab:blue", linestyle="--", label=f"mean of a perfect map, {floor:.3f} m")
histogram.set(xlabel="distance to the nearest voxel centre, m", ylabel="points", title="the published measure")
histogram.legend()
cumulative = surface["cumulative"]
curves.semilogx(cumulative["thresholds"], cumulative["shares"], label="accuracy: share of the map's points")
curves.semilogx(cumulative["thresholds"], cumulative["completeness"], label="completeness: share of the seen surface")
curves.semilogx(cumulative["thresholds"], cumulative["f_score"], label="F-score")
curves.set(xlabel="tolerance, m", ylim=(0, 1), title="against the exact surface")
curves.legend()
figure.savefig("map_error.png", dpi=120)

assert surface["median"] < 0.5 and not metrics["trajectory"]["ate_rmse"] > 0.5
