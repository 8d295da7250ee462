#pragma once

#include <filesystem>
#include <fstream>
#include <string>

#include "tileflight/core/imaging/image.h"
#include "tileflight/data/dataset/dataset.h"
#include "tileflight/slam/external_systems/adapter.h"

namespace tileflight::external_systems::test_support {

namespace fs = std::filesystem;

/// An adapter with this manifest and script, beside its name and inputs.
inline Adapter write_adapter(const fs::path& folder, const std::string& more, const std::string& script) {
  fs::create_directories(folder);
  std::ofstream(folder / "adapter.yaml") << "name: mine\ntakes: {inputs: [images], lenses: [any]}\n" << more;
  std::ofstream(folder / "run") << "#!/bin/sh\n" << script;
  fs::permissions(folder / "run", fs::perms::owner_all);
  return read_adapter(folder);
}

/// A dataset of `frames` frames, 0.1 s apart, from 5 s on.
inline dataset::Dataset write_dataset(const fs::path& folder, const imaging::Camera& camera, int frames = 4) {
  imaging::Calibration calibration;
  calibration.camera = camera;
  dataset::DatasetWriter writer(folder, calibration, {.png = true});
  geometry::Trajectory truth;
  for (int i = 0; i < frames; ++i) {
    const double time_s = 5.0 + 0.1 * i;
    imaging::RgbImage image(camera.width(), camera.height());
    for (auto& pixel : image.pixels) pixel = {200, 100, static_cast<std::uint8_t>(i)};
    writer.add_frame(static_cast<std::size_t>(i), time_s, 0.0, image);
    truth.poses.push_back({time_s, geometry::SE3(Eigen::Quaterniond::Identity(), geometry::Vec3(i, 0, 0))});
  }
  writer.set_groundtruth(truth);
  writer.finish();
  return dataset::read_dataset(folder);
}

}  // namespace tileflight::external_systems::test_support
