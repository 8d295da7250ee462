"""The first frame of a flight over the built-in stadium, and its depth: first_frame.png."""

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import tileflight as tf

if not Path("place").exists():
    tf.make_stadium("place")  # writes place/twin and place/world, both 3D Tiles

FIELD = (35.310344, -80.740007, 190)  # latitude, longitude, height above the ellipsoid
scene = tf.load("place/twin", center=FIELD, size=(250, 250, 120), origin=FIELD)
print(f"{scene.triangles} triangles, complete: {scene.complete}")

# A camera 27 m above the south end of the field looks north, 38 degrees down.
# Camera axes: x right, y down, z forward. Local axes: x east, y north, z up.
down = np.radians(38)
T_local_camera = np.eye(4)
T_local_camera[:3, :3] = np.column_stack([
    (1, 0, 0),                              # the image's right is east
    (0, -np.sin(down), -np.cos(down)),      # the image's down
    (0, np.cos(down), -np.sin(down)),       # the optical axis
])
T_local_camera[:3, 3] = (-2, -81, 27)

camera = tf.Camera.fisheye(960, 540, fov_deg=155)
frame = tf.Renderer(scene, camera, samples=4).render(T_local_camera)

figure, (left, right) = plt.subplots(1, 2, figsize=(11, 3.4), layout="constrained")
left.imshow(frame.rgb)
left.set_title("frame.rgb")
depth = np.where(np.isfinite(frame.depth), frame.depth, np.nan)
shown = right.imshow(depth, cmap="viridis", vmax=np.nanpercentile(depth, 98))
right.set_title("frame.depth")
figure.colorbar(shown, ax=right, label="metres along the optical axis")
for axes in (left, right):
    axes.set_axis_off()
figure.savefig("first_frame.png", dpi=120)

# The ray through the image's middle meets the surface where the depth says.
middle = camera.unproject([[(camera.width - 1) / 2, (camera.height - 1) / 2]])
hit = scene.cast_rays([T_local_camera[:3, 3]], middle @ T_local_camera[:3, :3].T)
print(f"surface in the middle of the image: {hit['distance'][0]:.2f} m away")
assert abs(hit["distance"][0] - depth[269:271, 479:481].mean()) < 0.5
