"""Makes docs/images/weather.jpg: one view of the built-in stadium in clear air, in fog, in rain, in snow, in dust and in the evening.

Usage: make_weather.py TILEFLIGHT TILESET OUT.jpg
TILESET is the stadium's `world` (`tileflight scene stadium DIR` writes DIR/world). The page is put together by Chromium.
"""
import pathlib
import sys
import tempfile

from chromium_sheet import run, write_sheet

CAMERA = """cam0:
  camera_model: pinhole
  intrinsics: [380.0, 380.0, 359.5, 219.5]
  distortion_model: equidistant
  distortion_coeffs: [0.0, 0.0, 0.0, 0.0]
  resolution: [720, 440]
"""
FLIGHT = """camera: camera.yaml
fps: 10
speed_m_s: 4
acceleration_m_s2: 4
max_frames: 6
waypoints:
  - {position: [-112, -118, 34], yaw_deg: 42, pitch_deg: -14}
  - {position: [-106, -112, 34], yaw_deg: 42, pitch_deg: -14}
"""
FRAME = 5
# name, weather, `render --degrade`
VIEWS = [
    ("clear", "", "exposure_time: 0.01\nexposure_samples: 1"),
    ("fog, visibility 200 m", "fog_visibility_m: 200", ""),
    ("ground fog: 60 m at the field, thinner by a factor of e every 8 m", "fog_visibility_m: 60\nscale_height_m: 8", ""),
    ("rain, 60 mm/h, wet ground, exposure 1/100 s", "rain_mm_per_h: 60\nwetness: 1\nwind_m_s: [2, 0]", "exposure_time: 0.01\nexposure_samples: 1"),
    ("snow, 2 mm/h, exposure 1/100 s", "snow_mm_per_h: 2\nwind_m_s: [1, 0]", "exposure_time: 0.01\nexposure_samples: 1"),
    ("dust, visibility 300 m", "dust_visibility_m: 300", ""),
    ("evening, 19:10 in March, sun and sky", "", "light: {time: 2024-03-20T19:10:00-04:00, white_balance: daylight}"),
    ("the same evening in mist", "fog_visibility_m: 1500\nscale_height_m: 60", "light: {time: 2024-03-20T19:10:00-04:00, white_balance: daylight}"),
]
SCRIPT = """
  const {names, cell: [width, height]} = data;
  const [sheet, draw] = makeSheet(2 * (width + 6), Math.ceil(images.length / 2) * (height + 26));
  images.forEach((image, i) => {
    const [left, top] = [i % 2 * (width + 6) + 3, Math.floor(i / 2) * (height + 26) + 3];
    draw.drawImage(image, 0, 0, image.width, image.height, left, top, width, height);
    draw.fillText(names[i], left + 2, top + height + 17);
  });
  document.body.textContent = sheet.toDataURL("image/jpeg", 0.8);
"""
CELL = (540, 330)  # pixels of each view


def render(tileflight, tileset, folder, number, weather, degrade):
    flight = folder / f"flight{number}.yaml"
    lines = "".join(f"  {line}\n" for line in weather.splitlines())
    flight.write_text(FLIGHT + (f"weather:\n{lines}" if lines else ""), encoding="utf-8")
    (folder / f"degrade{number}.yaml").write_text(degrade + "\n", encoding="utf-8")
    more = ["--degrade", str(folder / f"degrade{number}.yaml")] if degrade else []
    out = folder / f"dataset{number}"
    run([tileflight, "render", tileset, "--flight", str(flight), "--center", "35.310344,-80.740007,190", "--size", "700,700,150", "--out", str(out),
         "--png", "--quiet", *more])
    return out / "images" / f"{FRAME:06d}.png"


def main(tileflight, tileset, sheet):
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        (folder / "camera.yaml").write_text(CAMERA, encoding="utf-8")
        pictures = [render(tileflight, tileset, folder, i, weather, degrade) for i, (_, weather, degrade) in enumerate(VIEWS)]
        write_sheet(sheet, pictures, {"names": [view[0] for view in VIEWS], "cell": CELL}, SCRIPT, folder)


if __name__ == "__main__":
    if len(sys.argv) != 4:
        sys.exit(__doc__)
    main(*sys.argv[1:])
