#include "tileflight/capture/render/render_flight.h"

#include <tbb/parallel_pipeline.h>

#include <algorithm>
#include <chrono>
#include <mutex>
#include <optional>
#include <sstream>
#include <utility>

#include "tileflight/capture/render/frame_renderer.h"
#include "tileflight/core/base/input_error.h"

namespace tileflight::render {
namespace {

using geometry::Trajectory;

std::int64_t count_selected(const FrameRange& range, const FlightRenderOptions& options) {
  std::int64_t count = 0;
  for (std::size_t i = range.begin; i < range.end; ++i) count += options.frame_filter(i) ? 1 : 0;
  return count;
}

/// "frame 3", "frames 3 to 7".
std::string range_name(std::size_t first, std::size_t last) {
  if (first == last) return "frame " + std::to_string(first);
  return "frames " + std::to_string(first) + " to " + std::to_string(last);
}

using Checks = std::span<const std::optional<FrameCheck>>;

template <class Found>
std::vector<std::size_t> frames_where(Checks checks, std::size_t first_frame, const Found& found) {
  std::vector<std::size_t> frames;
  for (std::size_t i = 0; i < checks.size(); ++i) {
    if (checks[i] && found(*checks[i])) frames.push_back(first_frame + i);
  }
  return frames;
}

FlightRenderReport report_of(Checks checks, double seconds) {
  FlightRenderReport report;
  report.seconds = seconds;
  report.nearest_m = std::numeric_limits<double>::infinity();
  for (const std::optional<FrameCheck>& check : checks) {
    if (!check) continue;
    ++report.frames;
    report.mean_surface_share += check->view.surface_share();
    report.nearest_m = std::min(report.nearest_m, check->view.nearest_m);
  }
  if (report.frames > 0) report.mean_surface_share /= static_cast<double>(report.frames);
  report.frames_per_second = seconds > 0.0 ? static_cast<double>(report.frames) / seconds : 0.0;
  return report;
}

}  // namespace

std::vector<FlightFault> find_flight_faults(Checks checks, std::size_t first_frame, double clearance_m) {
  std::vector<FlightFault> faults;
  const auto look_for = [&](const std::string& key, const std::string& what, const auto& found) {
    std::vector<std::size_t> frames = frames_where(checks, first_frame, found);
    if (!frames.empty()) faults.push_back({key, what, std::move(frames)});
  };
  std::ostringstream near;
  near << "a surface is nearer to the camera than " << clearance_m << " m";
  look_for("camera_near_surface", near.str(), [&](const FrameCheck& check) {
    return std::min(check.view.nearest_m, check.surroundings.clearance_m) < clearance_m;
  });
  look_for("no_surface_in_view", "no surface is in view",
           [](const FrameCheck& check) { return check.view.surface_share() == 0.0; });
  look_for("camera_inside_surface", "the camera is inside or under a surface",
           [](const FrameCheck& check) { return check.surroundings.inside; });
  look_for("surfaces_seen_from_behind", "most surfaces are seen from behind; is the camera inside something?",
           [](const FrameCheck& check) { return check.view.back_face_share() > 0.5 && !check.surroundings.inside; });
  look_for("path_through_surface", "the path to the next frame goes through a surface",
           [](const FrameCheck& check) { return check.path_is_blocked; });
  return faults;
}

std::vector<std::string> flight_warnings(Checks checks, std::size_t first_frame, double clearance_m) {
  return fault_warnings(find_flight_faults(checks, first_frame, clearance_m));
}

std::vector<std::string> fault_warnings(const std::vector<FlightFault>& faults) {
  std::vector<std::string> warnings;
  for (const FlightFault& fault : faults) {
    for (std::size_t i = 0; i < fault.frames.size(); ++i) {
      const std::size_t first = fault.frames[i];
      while (i + 1 < fault.frames.size() && fault.frames[i + 1] == fault.frames[i] + 1) ++i;
      warnings.push_back(range_name(first, fault.frames[i]) + ": " + fault.what);
    }
  }
  return warnings;
}

FlightRenderReport render_flight(const scene::Scene& scene, const imaging::Camera& camera, const Trajectory& frames,
                                 const PoseFunction& pose_at, const FlightRenderOptions& options, const FrameSink& sink,
                                 const Progress& progress) {
  validate_image_formation(options.formation);
  if (options.render.weather) validate_weather(*options.render.weather);
  if (frames.empty()) throw InputError("flight", "there are no frames to render");
  if (options.max_frames_in_memory < 1) throw InputError("frames in flight", "must be at least 1");
  const auto start = std::chrono::steady_clock::now();
  const FrameRenderer maker(scene, camera, frames, pose_at, options);
  const FrameRange range = frame_range(options, frames.size());
  std::vector<std::optional<FrameCheck>> checks(range.count());
  std::size_t next = range.begin;
  // Counts frames of the whole flight, or only the selected ones if there is a filter.
  std::int64_t done = options.frame_filter ? 0 : static_cast<std::int64_t>(range.begin);
  const std::int64_t total =
      options.frame_filter ? count_selected(range, options) : static_cast<std::int64_t>(frames.size());
  std::mutex progress_mutex;

  const auto take = [&](tbb::flow_control& flow) -> std::size_t {
    while (next < range.end && options.frame_filter && !options.frame_filter(next)) ++next;
    if (next == range.end) flow.stop();
    return next++;
  };
  const auto make = [&](std::size_t index) -> FlightFrame {
    FlightFrame frame = maker.render(index);
    checks[index - range.begin] = frame.check;
    return frame;
  };
  const auto hand_over = [&](const FlightFrame& frame) {
    sink(frame);
    const std::scoped_lock lock(progress_mutex);
    report_progress(progress, ++done, total, "frames rendered");
  };
  // While one thread encodes a frame, others render tiles of the next ones; the tokens limit memory.
  tbb::parallel_pipeline(static_cast<std::size_t>(options.max_frames_in_memory),
                         tbb::make_filter<void, std::size_t>(tbb::filter_mode::serial_in_order, take) &
                             tbb::make_filter<std::size_t, FlightFrame>(tbb::filter_mode::parallel, make) &
                             tbb::make_filter<FlightFrame, void>(tbb::filter_mode::parallel, hand_over));

  const std::chrono::duration<double> seconds = std::chrono::steady_clock::now() - start;
  FlightRenderReport report = report_of(checks, seconds.count());
  report.exposure_after = maker.exposure_after();
  report.warnings = flight_warnings(checks, range.begin, options.clearance_m);
  return report;
}

}  // namespace tileflight::render
