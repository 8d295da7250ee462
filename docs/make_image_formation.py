"""Makes docs/images/image-formation.jpg: each effect of the simulated camera off (left) and on (right), over the built-in stadium.

Usage: make_image_formation.py TILEFLIGHT TILESET OUT.jpg
TILESET is the stadium's `world` (`tileflight scene stadium DIR` writes DIR/world). The page is put together by Chromium.
"""
import pathlib
import sys
import tempfile

from chromium_sheet import run, write_sheet

CAMERA = """cam0:
  camera_model: pinhole
  intrinsics: [420.0, 420.0, 399.5, 249.5]
  distortion_model: equidistant
  distortion_coeffs: [0.0, 0.0, 0.0, 0.0]
  resolution: [800, 500]
"""
# Fast and turning, so that blur and shear can be seen.
FLIGHT = """camera: camera.yaml
fps: 10
speed_m_s: 14
acceleration_m_s2: 12
yaw_rate_deg_s: 70
max_frames: 22
waypoints:
  - {position: [-50, -72, 22], yaw_deg: 10, pitch_deg: -24}
  - {position: [-22, -42, 18], yaw_deg: 60, pitch_deg: -26}
  - {position: [10, -20, 20], yaw_deg: 20, pitch_deg: -22}
"""
FRAME = 14
CELL = (260, 170)  # pixels of each half

# name, degrade, `render` options, middle of the crop as shares of the picture, size of the crop as a share of CELL
EFFECTS = [
    ("16 samples a pixel", "", ["--samples", "16"], (0.62, 0.40), 0.5),
    ("sun and sky, 18:15 in March", "light: {time: 2024-03-20T18:15:00-04:00, turbidity: 2.2}", [], (0.5, 0.5), 2.9),
    ("sun and sky, 13:00 in June", "light: {time: 2024-06-20T13:00:00-04:00}", [], (0.5, 0.5), 2.9),
    ("sun and sky, 8:00 in June, fixed white balance, haze",
     "light: {time: 2024-06-20T08:00:00-04:00, turbidity: 4, white_balance: daylight}\nhaze_visibility: 1500", [], (0.5, 0.5), 2.9),
    ("haze, visibility 150 m", "haze_visibility: 150", [], (0.5, 0.42), 2.2),
    ("chromatic aberration 0.8 %", "chromatic_red: 0.004\nchromatic_blue: -0.004", [], (0.12, 0.35), 0.5),
    ("motion blur, 1/30 s", "exposure_time: 0.033\nexposure_samples: 15", [], (0.4, 0.6), 0.9),
    ("rolling shutter, 80 ms", "line_delay: 0.00016", [], (0.5, 0.45), 2.2),
    ("vignetting 0.6", "vignetting: 0.6", [], (0.5, 0.5), 2.9),
    ("automatic exposure, target 0.1", "auto_exposure: {target: 0.1}", [], (0.5, 0.5), 2.2),
    ("noise, 400 electrons at white", "white_electrons: 400\nread_noise_electrons: 8", [], (0.4, 0.6), 0.7),
    ("response, gamma 1.6", "gamma: 1.6", [], (0.5, 0.5), 2.2),
    ("sharpening 2", "sharpening: 2\nsharpening_radius: 1.2", [], (0.62, 0.40), 0.5),
    ("H.264 at 0.8 Mbit/s", "video_bitrate: 0.8", [], (0.4, 0.6), 0.7),
    ("all of an action camera",
     "chromatic_red: 0.001\nexposure_time: 0.008\nexposure_samples: 5\nline_delay: 0.00003\nvignetting: 0.4\n"
     "white_electrons: 4000\nread_noise_electrons: 10\nsharpening: 1\nvideo_bitrate: 3", [], (0.5, 0.5), 2.2),
]


# Draws the cells two by two.
SCRIPT = """
  const {cells, half: [width, height]} = data;
  const cell = [2 * width + 8, height + 28];
  const [sheet, draw] = makeSheet(2 * cell[0], Math.ceil(cells.length / 2) * cell[1]);
  cells.forEach(({name, off, on, x, y, size}, i) => {
    const [left, top] = [i % 2 * cell[0] + 4, Math.floor(i / 2) * cell[1] + 3];
    draw.imageSmoothingEnabled = size >= 1;
    [off, on].forEach((picture, k) => {
      const [w, h] = [width * size, height * size];
      draw.drawImage(images[picture], (images[picture].width - w) * x, (images[picture].height - h) * y, w, h, left + k * width, top, width, height);
    });
    draw.fillText(name, left + 4, top + height + 17);
  });
  document.body.textContent = sheet.toDataURL("image/jpeg", 0.7);
"""


def render(tileflight, tileset, folder, name, degrade, options):
    out = folder / name
    (folder / f"{name}.yaml").write_text(degrade + "\n", encoding="utf-8")
    more = ["--degrade", str(folder / f"{name}.yaml")] if degrade else []
    run([tileflight, "render", tileset, "--flight", str(folder / "flight.yaml"), "--center", "35.310344,-80.740007,190", "--size", "500,500,150",
         "--out", str(out), "--png", "--quiet", *more, *options])
    return out / "images" / f"{FRAME:06d}.png"


def main(tileflight, tileset, sheet):
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        (folder / "camera.yaml").write_text(CAMERA, encoding="utf-8")
        (folder / "flight.yaml").write_text(FLIGHT, encoding="utf-8")
        pictures = [render(tileflight, tileset, folder, "off", "", [])]
        cells = []
        for index, (effect, degrade, options, (x, y), size) in enumerate(EFFECTS, 1):
            pictures.append(render(tileflight, tileset, folder, f"on{index}", degrade, options))
            cells.append({"name": effect, "off": 0, "on": index, "x": x, "y": y, "size": size})
        write_sheet(sheet, pictures, {"cells": cells, "half": CELL}, SCRIPT, folder)


if __name__ == "__main__":
    if len(sys.argv) != 4:
        sys.exit(__doc__)
    main(*sys.argv[1:])
