"""Odometry's path over the stadium against the true one: odometry_path.png."""

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import tileflight as tf

if not Path("place").exists():
    tf.make_stadium("place")

FIELD = (35.310344, -80.740007, 190)
tf.Camera.fisheye(640, 360, fov_deg=120).write("camera.yaml")
Path("flight.yaml").write_text("""\
camera: camera.yaml
fps: 5
speed_m_s: 3.6
acceleration_m_s2: 1.5
yaw_rate_deg_s: 15
waypoints:                       # metres east, north, up of the field's centre
  - {position: [-2, -80, 27], yaw_deg: 3, pitch_deg: -38}
  - {position: [5, -36, 24], yaw_deg: -3, pitch_deg: -37}
  - {position: [13, 20, 23], yaw_deg: -20, pitch_deg: -36}
  - {position: [-5, 50, 25], yaw_deg: -89, pitch_deg: -37}
""")

scene = tf.load("place/twin", center=FIELD, size=(400, 400, 120), origin=FIELD)
flight = tf.Flight.plan("flight.yaml", origin=scene.origin)

odometry = tf.Odometry(flight.camera)
for frame in tf.render_flight(scene, flight):
    odometry.add(frame.rgb, frame.time)      # images only: neither pose nor depth is handed over
result = odometry.finish()
print(f"{result['frames_tracked']} of {result['frames']} frames tracked")

# One camera does not know its scale: a similarity carries the estimated positions to the true ones.
estimated = result["trajectory"]
true_poses = flight.poses[np.searchsorted(flight.times, estimated["times"] - 1e-6)]
true_positions = true_poses[:, :3, 3]
T = tf.umeyama(estimated["poses"][:, :3, 3], true_positions)["T_target_source"]
positions = estimated["poses"][:, :3, 3] @ T[:3, :3].T + T[:3, 3]
error = np.linalg.norm(positions - true_positions, axis=1)

score = tf.evaluate_trajectory(**estimated, true_times=flight.times, true_poses=flight.poses)
print(f"path of {score['path_length']:.1f} m, ATE {score['ate_rmse']:.3f} m")

figure, (above, over_time) = plt.subplots(1, 2, figsize=(11, 4.2), layout="constrained")
above.plot(*flight.poses[:, :2, 3].T, color="0.6", linewidth=5, label="true")
above.plot(*positions[:, :2].T, color="tab:red", linewidth=1.5, label="odometry, aligned")
above.set(aspect="equal", xlabel="east, m", ylabel="north, m", title="from above")
above.legend()
over_time.plot(estimated["times"], 100 * error, color="tab:red")
over_time.set(xlabel="time, s", ylabel="distance from the true position, cm", ylim=(0, None), title="error")
figure.savefig("odometry_path.png", dpi=120)

assert score["ate_rmse"] < 0.5 and np.isclose(np.sqrt(np.mean(error**2)), score["ate_rmse"], rtol=0.02)
