#include "tests/fuzz/memory_file.h"
#include "tileflight/capture/missions/mission_path.h"
#include "tileflight/core/base/input_error.h"

/// A mission of any bytes: a plan, a list of waypoints, Litchi's table, KML, WPML or a KMZ; what is read is flown over
/// level ground.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace tileflight;
  const fuzz::MemoryFile file(data, size);
  try {
    const missions::Mission mission = missions::read_mission(file.path());
    const missions::MissionPlace place{geometry::LocalFrame({35.31, -80.74, {190.0}}),
                                       [](const std::vector<missions::GroundPoint>& points) {
                                         return std::vector<std::optional<double>>(points.size(), 190.0);
                                       }};
    missions::place_mission(mission, {.height_above_ground_m = 50.0}, place, 8.0, "mission");
  } catch (const InputError&) {
    // one clear line is what broken input is worth
  }
  return 0;
}
