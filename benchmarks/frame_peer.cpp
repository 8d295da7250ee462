// The peer of python_frames.py: the same images of the same scene, rendered from C++.
//
//   frame_peer TILESET WIDTH HEIGHT FRAMES    prints processor milliseconds an image
#include <cstdlib>
#include <ctime>
#include <iostream>
#include <string>

#include "tileflight/capture/render/camera_renderer.h"
#include "tileflight/tiles/tileset/load.h"
#include "tileflight/world/scene/scene.h"

namespace {

using namespace tileflight;

/// 40 m above the middle of the scene, looking straight down; x moves a millimetre an image.
geometry::SE3 pose_of(const scene::Scene& scene, int frame) {
  geometry::Mat3 r = geometry::Vec3(1, -1, -1).asDiagonal();
  return {r, scene.bounds().center() + geometry::Vec3(0.001 * frame, 0, 40)};
}

double processor_ms() {
  timespec time{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &time);
  return 1e3 * static_cast<double>(time.tv_sec) + 1e-6 * static_cast<double>(time.tv_nsec);
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 5) {
    std::cerr << "usage: frame_peer TILESET WIDTH HEIGHT FRAMES\n";
    return 2;
  }
  const int width = std::atoi(argv[2]), height = std::atoi(argv[3]), frames = std::atoi(argv[4]);
  const scene::Scene scene(tileset::load_region(argv[1], {}).meshes);
  const render::CameraRenderer renderer(scene, imaging::make_pinhole(width, height, 90.0), {.depth = true});
  (void)renderer.render(pose_of(scene, 0));
  const double begin = processor_ms();
  for (int i = 0; i < frames; ++i) {
    if (renderer.render(pose_of(scene, i)).rgb.width != width) return 1;
  }
  std::cout << (processor_ms() - begin) / frames << "\n";
}
