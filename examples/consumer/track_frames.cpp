// track_frames DATASET OUT.txt: odometry frame by frame. The pose of each image is printed as soon as it is known; the
// whole trajectory, refined, is written at the end as a TUM file.
#include <iostream>

#include "tileflight/core/base/input_error.h"
#include "tileflight/core/geometry/trajectory.h"
#include "tileflight/core/imaging/image_files.h"
#include "tileflight/data/dataset/dataset.h"
#include "tileflight/slam/odometry/odometry.h"

namespace {

void print(const std::string& id, const tileflight::odometry::FrameResult& frame) {
  std::cout << id << ": ";
  if (frame.T_map_camera) {
    std::cout << frame.T_map_camera->translation.transpose() << '\n';
  } else {
    std::cout << frame.reason << '\n';
  }
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 3) {
    std::cerr << "usage: track_frames DATASET OUT.txt\n";
    return 1;
  }
  try {
    const tileflight::dataset::Dataset data = tileflight::dataset::read_dataset(argv[1]);
    tileflight::odometry::Odometry odometry(data.calibration);
    for (const tileflight::dataset::Frame& frame : data.frames)
      print(frame.id, odometry.add(tileflight::imaging::read_rgb(frame.image), frame.time_s));

    const tileflight::odometry::OdometryResult result = odometry.finish();
    tileflight::geometry::write_tum(argv[2], result.trajectory);
    std::cout << result.frames_tracked << " of " << result.frames << " images tracked, " << result.map.positions.size()
              << " map points\n";
    return result.lost ? 2 : 0;
  } catch (const tileflight::InputError& error) {
    std::cerr << error.what() << '\n';
    return 1;
  }
}
