#include "tileflight/odometry/odometry.h"

#include <chrono>

#include "tileflight/odometry/odometry_pipeline.h"
#include "tileflight/odometry/prior_alignment.h"

namespace tileflight::odometry {

OdometryResult run_odometry(const imaging::Calibration& calibration, const imaging::PhotometricCalibration* photometric,
                            const FrameSource& next_frame, const photometry::OdometryOptions& options,
                            const Progress& progress, const Priors& aids, const KeyframeObserver& observer) {
  const auto begin = std::chrono::steady_clock::now();
  OdometryPipeline engine(calibration, photometric, options, aids, observer);
  std::int64_t frames = 0;
  while (!engine.lost()) {
    std::optional<InputFrame> frame = next_frame();
    if (!frame) break;
    engine.add(std::move(*frame));
    report_progress(progress, ++frames, 0, engine.progress_text());
  }
  OdometryResult result = engine.result();
  if (engine.initialization_end_s()) apply_priors(calibration.camera, aids, *engine.initialization_end_s(), result);
  result.wall_time_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  return result;
}

}  // namespace tileflight::odometry
