#include "tileflight/odometry/odometry.h"

#include <chrono>

#include "tileflight/odometry/engine.h"
#include "tileflight/odometry/known_start.h"

namespace tileflight::odometry {

OdometryResult run_odometry(const imaging::Calibration& calibration, const imaging::PhotometricCalibration* photometric,
                            const FrameSource& next_frame, const OdometryOptions& options, const Progress& progress,
                            const Aids& aids, const KeyframeObserver& observer) {
  const auto begin = std::chrono::steady_clock::now();
  Engine engine(calibration, photometric, options, aids, observer);
  std::int64_t frames = 0;
  while (!engine.lost()) {
    std::optional<InputFrame> frame = next_frame();
    if (!frame) break;
    engine.add(std::move(*frame));
    report_progress(progress, ++frames, 0, engine.state());
  }
  OdometryResult result = engine.result();
  if (engine.start_time_s()) place(calibration.camera, aids, *engine.start_time_s(), result);
  result.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  return result;
}

}  // namespace tileflight::odometry
