#include <condition_variable>
#include <ctime>
#include <map>
#include <mutex>
#include <thread>

#include "arrays.h"
#include "bindings.h"
#include "input_options.h"
#include "interruptible.h"
#include "tileflight/capture/recording/planned_flight.h"
#include "tileflight/capture/render/camera_renderer.h"
#include "tileflight/capture/render/daylight.h"
#include "tileflight/capture/render/render_flight.h"

namespace tileflight::python {
namespace {

/// A rendered image as arrays.
struct Frame {
  std::int64_t index = 0;
  double time_s = 0.0;
  double exposure_ms = 0.0;
  py::array_t<std::uint8_t> rgb;
  py::object depth = py::none();  ///< array or None
  py::object pose = py::none();   ///< 4x4 array
};

py::object depth_array(imaging::FloatImage depth) {
  return depth.empty() ? py::object(py::none()) : py::object(image_to_array(std::move(depth)));
}

/// Renders images of one camera in a scene.
class Renderer {
 public:
  Renderer(SceneHandle scene, const imaging::Camera& camera, int samples, bool depth, const imaging::Rgb8& background,
           double haze_per_m, const std::optional<double>& utc)
      : scene_(std::move(scene)) {
    if (samples != 1 && samples != 4 && samples != 9 && samples != 16)
      throw py::value_error("samples must be 1, 4, 9 or 16");
    if (!(haze_per_m >= 0.0)) throw py::value_error("haze_per_m must not be negative");
    render::RenderOptions options{
        .depth = depth, .samples_per_pixel = samples, .background = background, .haze_per_m = haze_per_m};
    if (utc) options.daylight = render::make_daylight({.utc_s = *utc}, scene_->origin());
    const py::gil_scoped_release unlocked;
    renderer_ = std::make_unique<render::CameraRenderer>(scene_->scene, camera, options);
  }

  const imaging::Camera& camera() const { return renderer_->camera(); }

  Frame render(const InputArray<double>& T_local_camera) const {
    const geometry::SE3 pose = rigid_motion_from(T_local_camera, "T_local_camera");
    render::RenderedFrame rendered;
    {
      const py::gil_scoped_release unlocked;
      rendered = renderer_->render(pose);
    }
    Frame frame;
    frame.rgb = image_to_array(std::move(rendered.rgb));
    frame.depth = depth_array(std::move(rendered.depth_m));
    frame.pose = py::cast(pose.matrix());
    return frame;
  }

 private:
  SceneHandle scene_;
  std::unique_ptr<render::CameraRenderer> renderer_;
};

/// A flight that a FLIGHT file describes, ready to be rendered.
struct Flight {
  recording::PlannedFlight plan;
};

std::shared_ptr<Flight> plan_flight(const std::filesystem::path& flight_file, const std::vector<double>& origin,
                                    const std::string& camera, std::uint64_t seed, int samples) {
  recording::RenderSettings settings;
  settings.flight.flight = flight_file;
  settings.fly_autopilot = app::autopilot_flyer();
  settings.flight.camera = camera;
  settings.flight.samples_per_pixel = samples;
  settings.seed = seed;
  app::RegionOptions region;
  region.origin = origin;
  settings.load = app::load_options(region);
  return call_interruptibly(py::none(), [&](const Progress& report) {
    return std::make_shared<Flight>(Flight{recording::plan_flight(settings, report)});
  });
}

/// Iterates over the frames of a flight in order. A thread renders them; at most kMaxAhead frames wait to be taken.
class FlightFrames {
 public:
  FlightFrames(SceneHandle scene, std::shared_ptr<Flight> flight, bool depth, std::size_t first, std::size_t end)
      : scene_(std::move(scene)), flight_(std::move(flight)) {
    options_ = flight_->plan.options;
    options_.render.depth = depth;
    options_.outputs = {};
    options_.origin = scene_->origin();
    options_.first_frame = first;
    options_.end_frame = std::min(end, flight_->plan.frames.size());
    next_ = first;
    if (first >= options_.end_frame)
      throw py::value_error("no frames: the flight has " + std::to_string(flight_->plan.frames.size()));
    thread_ = std::thread([this] { run(); });
  }
  ~FlightFrames() { stop(); }
  FlightFrames(const FlightFrames&) = delete;
  FlightFrames& operator=(const FlightFrames&) = delete;

  /// Ends the rendering and drops the frames that were not taken.
  void stop() {
    {
      const std::lock_guard lock(mutex_);
      stopped_ = true;
      changed_.notify_all();
    }
    if (!thread_.joinable()) return;
    if (PyGILState_Check() == 0) return thread_.join();
    const py::gil_scoped_release unlocked;
    thread_.join();
  }

  Frame next() {
    std::optional<render::FlightFrame> frame;
    while (!frame) {
      if (PyErr_CheckSignals() != 0) throw py::error_already_set();
      const py::gil_scoped_release unlocked;
      frame = wait_for_next();
    }
    Frame result;
    result.index = static_cast<std::int64_t>(frame->index);
    result.time_s = frame->time_s;
    result.exposure_ms = frame->exposure_ms;
    result.rgb = image_to_array(std::move(frame->rgb));
    result.depth = depth_array(std::move(frame->depth_m));
    result.pose = py::cast(flight_->plan.frames.poses[frame->index].T_local_camera.matrix());
    return result;
  }

 private:
  struct Stopped {};

  /// Waits at most 50 ms for the next frame in order. Throws py::stop_iteration after the last one, and what rendering
  /// threw.
  std::optional<render::FlightFrame> wait_for_next() {
    std::unique_lock lock(mutex_);
    const auto is_next_there = [this] { return !ready_.empty() && ready_.begin()->first == next_; };
    changed_.wait_for(lock, std::chrono::milliseconds(50), [&] { return is_next_there() || ended_; });
    if (is_next_there()) {
      render::FlightFrame frame = std::move(ready_.begin()->second);
      ready_.erase(ready_.begin());
      ++next_;
      changed_.notify_all();
      return frame;
    }
    if (!ended_) return std::nullopt;
    if (failure_) std::rethrow_exception(std::exchange(failure_, nullptr));
    throw py::stop_iteration();
  }

  void take(const render::FlightFrame& frame) {
    std::unique_lock lock(mutex_);
    // The next frame in order must always find room, or no thread would ever make room.
    changed_.wait(lock, [&] { return stopped_ || frame.index < next_ + kMaxAhead; });
    if (stopped_) throw Stopped();
    ready_.emplace(frame.index, frame);
    changed_.notify_all();
  }

  void run() {
    std::exception_ptr failure;
    try {
      render::render_flight(scene_->scene, flight_->plan.calibration.camera, flight_->plan.frames,
                            flight_->plan.pose_at, options_, [this](const render::FlightFrame& frame) { take(frame); });
    } catch (const Stopped&) {
    } catch (...) {
      failure = std::current_exception();
    }
    const std::lock_guard lock(mutex_);
    failure_ = failure;
    ended_ = true;
    changed_.notify_all();
  }

  static constexpr std::size_t kMaxAhead = 8;  ///< at least FlightRenderOptions::max_frames_in_memory

  SceneHandle scene_;
  std::shared_ptr<Flight> flight_;
  render::FlightRenderOptions options_;
  std::mutex mutex_;
  std::condition_variable changed_;
  std::map<std::size_t, render::FlightFrame> ready_;
  std::size_t next_ = 0;
  bool ended_ = false, stopped_ = false;
  std::exception_ptr failure_;
  std::thread thread_;
};

}  // namespace

void bind_render(py::module_& module) {
  using py::arg;
  py::class_<Frame>(module, "Frame", "A rendered image with its depth and pose.")
      .def_readonly("index", &Frame::index, "Number in the flight; 0 for a single image.")
      .def_readonly("time", &Frame::time_s, "Seconds; 0 for a single image.")
      .def_readonly("exposure_ms", &Frame::exposure_ms, "Exposure time, milliseconds; 0: none stated.")
      .def_readonly("rgb", &Frame::rgb, "(height, width, 3) uint8; black outside the lens's valid cone.")
      .def_readonly("depth", &Frame::depth,
                    "(height, width) float32, metres along the optical axis for the ray through the pixel's centre; "
                    "infinite where nothing is hit, NaN outside the valid cone; or None.")
      .def_readonly("pose", &Frame::pose, "T_local_camera (4, 4): camera (x right, y down, z forward) to local.");
  py::class_<Renderer>(module, "Renderer", "Renders images of one camera in one scene by ray casting.")
      .def(py::init<SceneHandle, const imaging::Camera&, int, bool, const imaging::Rgb8&, double,
                    const std::optional<double>&>(),
           arg("scene"), arg("camera"), py::kw_only(), arg("samples") = 1, arg("depth") = true,
           arg("background") = imaging::Rgb8{135, 180, 225}, arg("haze_per_m") = 0.0, arg("utc") = py::none(),
           "samples: rays a pixel, 1, 4, 9 or 16. haze_per_m: extinction. utc: seconds since 1970 for light by sun and "
           "sky instead of the textures' own; needs a georeferenced place.")
      .def_property_readonly("camera", &Renderer::camera)
      .def("render", &Renderer::render, arg("T_local_camera"),
           "The image from a pose (4, 4). Several threads may render at once.");
  py::class_<Flight, std::shared_ptr<Flight>>(module, "Flight", "A flight ready to be rendered: camera, times, poses.")
      .def_static("plan", &plan_flight, arg("flight_file"), py::kw_only(), arg("origin") = std::vector<double>{},
                  arg("camera") = "", arg("seed") = 1, arg("samples") = 1,
                  "Plans the flight of a FLIGHT file. origin: latitude, longitude, ellipsoidal height of the local "
                  "frame (Scene.origin), for flights with geodetic waypoints. camera: a calibration file that replaces "
                  "the flight's.")
      .def_property_readonly("camera", [](const Flight& f) { return f.plan.calibration.camera; })
      .def_property_readonly(
          "times", [](const Flight& f) { return times_of(f.plan.frames); }, "(N) seconds.")
      .def_property_readonly(
          "poses", [](const Flight& f) { return poses_of(f.plan.frames); }, "T_local_camera of each image (N, 4, 4).")
      .def("__len__", [](const Flight& f) { return f.plan.frames.size(); });
  py::class_<FlightFrames>(module, "FlightFrames",
                           "Iterator over the frames of a flight. Up to eight frames are rendered ahead.")
      .def("__iter__", [](py::object self) { return self; })
      .def("__next__", &FlightFrames::next)
      .def("close", &FlightFrames::stop, "Ends the rendering.")
      .def("__enter__", [](py::object self) { return self; })
      .def("__exit__", [](FlightFrames& self, const py::args&) { self.stop(); });
  module.def(
      "render_flight",
      [](SceneHandle scene, std::shared_ptr<Flight> flight, bool depth, std::size_t first,
         const std::optional<std::size_t>& end) {
        return std::make_unique<FlightFrames>(std::move(scene), std::move(flight), depth, first,
                                              end.value_or(std::numeric_limits<std::size_t>::max()));
      },
      arg("scene"), arg("flight"), py::kw_only(), arg("depth") = false, arg("first") = 0, arg("end") = py::none(),
      "The frames of a planned flight in order, with its shutter, exposure and noise: the pixels that `tileflight "
      "render` writes from the same tiles if the scene's anchor is the position in the middle of the flight. Memory is "
      "bounded: some eight frames.");
}

}  // namespace tileflight::python
