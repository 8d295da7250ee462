"""Makes docs/images/localize.jpg: images of the stadium's second flight, the place rendered from where `localize` found them, and what differs.

Usage: make_localize.py TILEFLIGHT RUN OUT.jpg
RUN is a run of examples/stadium.yaml: its second flight films the stadium's `world` with a degraded camera, and its truth is the coarser `twin`. It also
prints the errors of the located poses. The sheet is put together by Chromium.
"""
import csv
import math
import pathlib
import shutil
import statistics
import sys
import tempfile

from chromium_sheet import run, write_sheet

CELL = (320, 180)  # pixels of each picture
SCRIPT = """
  const {names, cell: [width, height], heads} = data;
  const [sheet, draw] = makeSheet(4 * (width + 6), names.length * (height + 26) + 24);
  heads.forEach((head, i) => draw.fillText(head, i * (width + 6) + 5, 17));
  const grey = (image) => {
    const canvas = document.createElement("canvas"); [canvas.width, canvas.height] = [width, height];
    const context = canvas.getContext("2d"); context.imageSmoothingQuality = "high"; context.drawImage(image, 0, 0, width, height);
    const pixels = context.getImageData(0, 0, width, height).data;
    return Float64Array.from({length: width * height}, (_, k) => 0.299 * pixels[4 * k] + 0.587 * pixels[4 * k + 1] + 0.114 * pixels[4 * k + 2]);
  };
  const normalized = (values) => {  // by the mean and the deviation in a window of seven pixels
    const reach = 3, out = new Float64Array(values.length);
    for (let y = 0; y < height; ++y) for (let x = 0; x < width; ++x) {
      let n = 0, sum = 0, squares = 0;
      for (let v = Math.max(0, y - reach); v <= Math.min(height - 1, y + reach); ++v)
        for (let u = Math.max(0, x - reach); u <= Math.min(width - 1, x + reach); ++u) { const value = values[v * width + u]; n += 1; sum += value; squares += value * value; }
      const mean = sum / n;
      out[y * width + x] = (values[y * width + x] - mean) / (Math.sqrt(Math.max(0, squares / n - mean * mean)) + 4);
    }
    return out;
  };
  names.forEach((name, row) => {
    const [seen, shown] = [images[2 * row], images[2 * row + 1]], top = 24 + row * (height + 26);
    const left = (column) => column * (width + 6) + 3;
    draw.drawImage(seen, left(0), top, width, height);
    draw.drawImage(shown, left(1), top, width, height);
    const block = 20;
    for (let y = 0; y < height; y += block) for (let x = 0; x < width; x += block) {
      const image = (x / block + y / block) % 2 ? seen : shown, across = image.width / width, down = image.height / height;
      draw.drawImage(image, x * across, y * down, block * across, block * down, left(2) + x, top + y, block, block);
    }
    const [a, b] = [normalized(grey(seen)), normalized(grey(shown))], residual = draw.createImageData(width, height);
    a.forEach((value, k) => residual.data.set([128 + 40 * (value - b[k]), 128 + 40 * (value - b[k]), 128 + 40 * (value - b[k]), 255], 4 * k));
    draw.putImageData(residual, left(3), top);
    draw.fillText(name, left(0) + 2, top + height + 17);
  });
  document.body.textContent = sheet.toDataURL("image/jpeg", 0.8);
"""
HEADS = ["the image", "the place from where it was located", "both by turns", "difference after division by local contrast"]


def read_poses(file):
    return {line.split()[0]: [float(word) for word in line.split()[1:]] for line in file.read_text(encoding="utf-8").splitlines() if line and line[0] != "#"}


def main(tileflight, run_folder, sheet):
    run_folder = pathlib.Path(run_folder)
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        run([tileflight, "localize", run_folder / "real/dataset", "--to", run_folder / "truth", "--odometry", run_folder / "real/odometry", "--out", folder / "located"])
        located = {round(float(time), 4): pose for time, pose in read_poses(folder / "located/trajectory.txt").items()}
        true_poses = {round(float(time), 4): pose for time, pose in read_poses(run_folder / "real/dataset/groundtruth.txt").items()}
        errors = {time: math.dist(pose[:3], true_poses[time][:3]) for time, pose in located.items()}
        print(f"{len(located)} of {len(true_poses)} images, median {statistics.median(errors.values()):.3f} m, largest {max(errors.values()):.3f} m")
        with open(folder / "located/quality.csv", encoding="utf-8", newline="") as file:
            quality = list(csv.DictReader(file))
        chosen = [quality[k * len(quality) // 6] for k in (1, 3, 5)]
        poses = "".join(f"{row['time_s']} " + " ".join(map(str, located[round(float(row["time_s"]), 4)])) + "\n" for row in chosen)
        (folder / "poses.txt").write_text(poses, encoding="utf-8")
        shutil.copy(run_folder / "real/dataset/camera.yaml", folder / "camera.yaml")
        (folder / "flight.yaml").write_text("camera: camera.yaml\ntrajectory: poses.txt\n", encoding="utf-8")
        run([tileflight, "render", run_folder / "place/twin", "--flight", folder / "flight.yaml", "--origin", "35.310344,-80.740007,190", "--png", "--quiet", "--out", folder / "shown"])
        pictures, names = [], []
        for k, row in enumerate(chosen):
            pictures += [run_folder / f"real/dataset/images/{row['frame']}.jpg", folder / f"shown/images/{k:06d}.png"]
            names.append(f"{float(row['time_s']):.1f} s: {errors[round(float(row['time_s']), 4)]:.3f} m off, stated sigma {float(row['sigma_position_m']):.3f} m, correlation {float(row['correlation']):.2f}")
        write_sheet(sheet, pictures, {"names": names, "cell": CELL, "heads": HEADS}, SCRIPT, folder)


if __name__ == "__main__":
    if len(sys.argv) != 4:
        sys.exit(__doc__)
    main(*sys.argv[1:])
