#include "tileflight/data/exports/layout_writers.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <mutex>

#include "tileflight/core/base/files.h"
#include "tileflight/core/base/formatted_text.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/raw_bytes.h"
#include "tileflight/core/imaging/image_files.h"
#include "tileflight/data/dataset/frame_list.h"

namespace tileflight::exports {

namespace {

namespace fs = std::filesystem;

/// Calls `write` for each frame, in parallel.
void for_each_frame(const dataset::Dataset& dataset, const fs::path& folder, const Progress& progress,
                    const std::function<void(std::size_t index)>& write) {
  std::error_code error;
  fs::create_directories(folder, error);
  if (error) throw InputError(folder.string(), "cannot be created: " + error.message());
  const auto frames = static_cast<std::int64_t>(dataset.frames.size());
  std::mutex mutex;
  std::int64_t done = 0;
  tbb::parallel_for(std::size_t{0}, dataset.frames.size(), [&](std::size_t i) {
    write(i);
    const std::lock_guard lock(mutex);
    report_progress(progress, ++done, frames, "writing images");
  });
}

void copy_bytes(const fs::path& from, const fs::path& to) {
  const std::vector<std::byte> bytes = base::read_bytes(from);
  base::write_file(to, {reinterpret_cast<const char*>(bytes.data()), bytes.size()});
}

}  // namespace

void note_reading_warnings(const dataset::Rig& rig, std::vector<std::string>& notes) {
  for (const dataset::RigCamera& camera : rig.cameras) base::add_distinct(camera.dataset.warnings, notes);
}

void note_cameras_left_out(const dataset::Rig& rig, std::size_t held, std::vector<std::string>& notes) {
  for (std::size_t c = held; c < rig.cameras.size(); ++c)
    notes.push_back("camera " + rig.cameras[c].name + " has no place in this layout; export it alone (--camera " +
                    rig.cameras[c].name + ")");
}

void note_data_left_out(const dataset::Rig& rig, const std::vector<std::string>& held,
                        std::vector<std::string>& notes) {
  const auto is_there = [&](const std::string& name) {
    return std::ranges::any_of(rig.cameras, [&](const dataset::RigCamera& camera) {
      const dataset::Dataset& dataset = camera.dataset;
      if (fs::exists(dataset.folder / name)) return true;
      if (name == "depth")
        return std::ranges::any_of(dataset.frames, [](const auto& one) { return !one.depth.empty(); });
      return (name == "imu.csv" && !dataset.imu.empty()) || (name == "gps.csv" && !dataset.gps.empty());
    });
  };
  std::vector<std::string> left_out;
  for (const char* name :
       {"depth", "range", "normals", "segmentation", "infrared", "flow", "visibility", "boxes", "events", "lidar",
        "imu.csv", "imu_bias.csv", "gps.csv", "attitude.csv", "barometer.csv", "magnetometer.csv", "range.csv"}) {
    if (std::ranges::find(held, name) == held.end() && is_there(name)) left_out.emplace_back(name);
  }
  if (!left_out.empty()) notes.push_back("left out, as this layout has no place for it: " + base::joined(left_out));
}

std::vector<std::array<std::size_t, 2>> stereo_pairs(const dataset::Rig& rig) {
  std::vector<std::array<std::size_t, 2>> pairs;
  for (const dataset::RigInstant& instant : dataset::rig_instants(rig)) {
    if (instant.frames[0] && instant.frames[1]) pairs.push_back({*instant.frames[0], *instant.frames[1]});
  }
  return pairs;
}

double frame_rate_hz(const dataset::Dataset& dataset) {
  if (dataset.frames.size() < 2) return 1.0;
  const double span_s = dataset.frames.back().time_s - dataset.frames.front().time_s;
  return std::round(1e6 * static_cast<double>(dataset.frames.size() - 1) / span_s) / 1e6;
}

void copy_frames(const dataset::Dataset& dataset, const fs::path& folder, const FrameNamer& stem_of,
                 const Progress& progress) {
  for_each_frame(dataset, folder, progress, [&](std::size_t i) {
    const fs::path& image = dataset.frames[i].image;
    copy_bytes(image, folder / (stem_of(i) + image.extension().string()));
  });
}

void write_png_frames(const dataset::Dataset& dataset, const fs::path& folder, const FrameNamer& stem_of,
                      const Progress& progress) {
  for_each_frame(dataset, folder, progress, [&](std::size_t i) {
    const fs::path& image = dataset.frames[i].image;
    const fs::path target = folder / (stem_of(i) + ".png");
    if (image.extension() == ".png")
      copy_bytes(image, target);
    else
      base::write_file(target, base::as_text(encode_png(imaging::read_rgb(image), imaging::PngEffort::kLittleTime)));
  });
}

}  // namespace tileflight::exports
