#pragma once

#include <filesystem>
#include <string>

#include "tests/shared_result.h"
#include "tileflight/core/geometry/trajectory.h"
#include "tileflight/data/dataset/dataset.h"
#include "tileflight/slam/odometry/synthetic_flight.h"

namespace tileflight::tests {

/// A flight of a second over small hills as a dataset folder: 36 pictures of 280x180 by a wide lens, with its truth.
/// Rendered once, by rays that know nothing of the odometry.
class TinyFlight {
 public:
  static constexpr int kFrames = 36;

  static const odometry::test_support::Sequence& sequence() {
    static const odometry::test_support::Sequence kSequence =
        odometry::test_support::render_hill_flight(imaging::make_fisheye(280, 180, 130.0), kFrames);
    return kSequence;
  }

  static geometry::Trajectory truth() {
    geometry::Trajectory poses;
    for (int i = 0; i < kFrames; ++i) poses.poses.push_back({i / 30.0, sequence().truth[i]});
    return poses;
  }

  /// The dataset's folder, from which each test takes a copy that it may spoil.
  static SharedResult shared_dataset() { return {"tiny-flight", &TinyFlight::write}; }
  static void copy_to(const std::filesystem::path& folder) { shared_dataset().copy_to(folder); }

 private:
  static void write(const std::filesystem::path& folder) {
    dataset::DatasetWriter writer(folder, sequence().calibration, {});
    for (int i = 0; i < kFrames; ++i) writer.add_frame(i, i / 30.0, 0.0, sequence().images[i]);
    writer.set_groundtruth(truth());
    writer.finish();
  }
};

}  // namespace tileflight::tests
