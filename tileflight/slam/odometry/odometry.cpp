#include "tileflight/slam/odometry/odometry.h"

#include <chrono>

#include "tileflight/core/base/input_error.h"
#include "tileflight/slam/odometry/odometry_pipeline.h"

namespace tileflight::odometry {
namespace {

double steady_time_s() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

}  // namespace

Odometry::Odometry(OdometryInput input, const OdometryOptions& options) : begin_s_(steady_time_s()) {
  if (input.calibration.camera.width() <= 0 || input.calibration.camera.height() <= 0)
    throw InputError("calibration", "has no image size; give the width and height of the images");
  pipeline_ = std::make_unique<OdometryPipeline>(std::move(input), options);
}
Odometry::Odometry(Odometry&&) noexcept = default;
Odometry& Odometry::operator=(Odometry&&) noexcept = default;
Odometry::~Odometry() = default;

OdometryPipeline& Odometry::pipeline() const {
  if (!pipeline_) throw InputError("odometry", "is finished; begin a new one for further images");
  return *pipeline_;
}

FrameResult Odometry::add(InputFrame frame, const std::optional<geometry::SE3>& T_world_camera) {
  return pipeline().add(std::move(frame), T_world_camera);
}

FrameResult Odometry::add(imaging::RgbImage image, double time_s, const std::optional<geometry::SE3>& T_world_camera) {
  return add(InputFrame{.index = frames(), .time_s = time_s, .image = std::move(image)}, T_world_camera);
}

bool Odometry::lost() const { return pipeline().lost(); }
std::int64_t Odometry::frames() const { return pipeline().frames(); }
std::string Odometry::progress_text() const { return pipeline().progress_text(); }
geometry::Trajectory Odometry::trajectory() const { return pipeline().trajectory(); }
geometry::Trajectory Odometry::keyframes() const { return pipeline().keyframes(); }
std::vector<inertial::VisualKeyframe> Odometry::latest_keyframes(std::size_t count) const {
  return pipeline().latest_keyframes(count);
}
geometry::PointCloud Odometry::map() const { return pipeline().map(); }
std::optional<geometry::Sim3> Odometry::T_world_map() const { return pipeline().T_world_map(); }

OdometryResult Odometry::finish() {
  OdometryResult result = pipeline().result();
  pipeline_.reset();
  result.wall_time_s = steady_time_s() - begin_s_;
  return result;
}

OdometryResult run_odometry(OdometryInput input, const FrameSource& next_frame, const OdometryOptions& options,
                            const Progress& progress) {
  Odometry odometry(std::move(input), options);
  while (!odometry.lost()) {
    std::optional<InputFrame> frame = next_frame();
    if (!frame) break;
    odometry.add(std::move(*frame));
    report_progress(progress, odometry.frames(), 0, odometry.progress_text());
  }
  return odometry.finish();
}

}  // namespace tileflight::odometry
