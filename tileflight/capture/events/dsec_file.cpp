#include "tileflight/capture/events/dsec_file.h"

#include <hdf5.h>

#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>
#include <limits>
#include <string>
#include <utility>

#include "tileflight/core/base/files.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/output_folder.h"
#include "tileflight/data/dataset/frame_list.h"
#include "tileflight/data/exports/layout_writers.h"

namespace tileflight::events {

namespace {

/// Owns an object of the HDF5 library.
class Hdf5Handle {
 public:
  using Close = herr_t (*)(hid_t);

  Hdf5Handle() = default;
  /// Takes the result of a call of the library. Throws InputError (place, the library's last message) if it failed.
  Hdf5Handle(hid_t id, Close close, const std::string& place);
  ~Hdf5Handle() { reset(); }
  Hdf5Handle(Hdf5Handle&& other) noexcept : id_(std::exchange(other.id_, -1)), close_(other.close_) {}
  Hdf5Handle& operator=(Hdf5Handle&& other) noexcept {
    reset();
    id_ = std::exchange(other.id_, -1);
    close_ = other.close_;
    return *this;
  }

  operator hid_t() const { return id_; }
  void reset() {
    if (id_ >= 0) close_(id_);
    id_ = -1;
  }

 private:
  hid_t id_ = -1;
  Close close_ = nullptr;
};

/// Silences the HDF5 library's error messages on this thread while it lives.
class QuietHdf5 {
 public:
  QuietHdf5();
  ~QuietHdf5();
  QuietHdf5(const QuietHdf5&) = delete;
  QuietHdf5& operator=(const QuietHdf5&) = delete;

 private:
  H5E_auto2_t print_ = nullptr;
  void* to_ = nullptr;
};

/// The innermost of the library's messages.
herr_t take_message(unsigned depth, const H5E_error2_t* error, void* message) {
  if (depth == 0 && error->desc != nullptr) *static_cast<std::string*>(message) = error->desc;
  return 0;
}

[[noreturn]] void throw_failure(const std::string& place) {
  std::string message;
  H5Ewalk2(H5E_DEFAULT, H5E_WALK_UPWARD, take_message, &message);
  for (char& c : message) {
    if (c == '\n' || c == '\r') c = ' ';
  }
  throw InputError(place, "HDF5 failed: " + (message.empty() ? std::string("no cause known") : message));
}

Hdf5Handle::Hdf5Handle(hid_t id, Close close, const std::string& place) : id_(id), close_(close) {
  if (id < 0) throw_failure(place);
}

/// Throws InputError (place, the library's last message) if a call failed.
void require_hdf5(herr_t result, const std::string& place) {
  if (result < 0) throw_failure(place);
}

QuietHdf5::QuietHdf5() {
  H5Eget_auto2(H5E_DEFAULT, &print_, &to_);
  H5Eset_auto2(H5E_DEFAULT, nullptr, nullptr);
}

QuietHdf5::~QuietHdf5() { H5Eset_auto2(H5E_DEFAULT, print_, to_); }

namespace fs = std::filesystem;

using dataset::RigCamera;
using geometry::Mat3;
using geometry::SE3;
using geometry::Vec3;

fs::path events_of(const RigCamera& camera) { return camera.dataset.folder / "events.h5"; }

/// The cameras with events, in their order.
std::vector<const RigCamera*> event_cameras(const dataset::Rig& rig) {
  std::vector<const RigCamera*> cameras;
  for (const RigCamera& camera : rig.cameras) {
    if (fs::is_regular_file(events_of(camera))) cameras.push_back(&camera);
  }
  if (cameras.empty())
    throw InputError(rig.cameras.front().dataset.folder.string(),
                     "has no events.h5; render the flight with 'events' (docs/events.md)");
  return cameras;
}

/// One list of two numbers a pixel.
void write_rectify_map(const fs::path& file, const imaging::Image<std::array<float, 2>>& map) {
  const QuietHdf5 quiet;
  const std::string place = file.string();
  const Hdf5Handle open(H5Fcreate(file.c_str(), H5F_ACC_TRUNC, H5P_DEFAULT, H5P_DEFAULT), H5Fclose, place);
  const std::array<hsize_t, 3> shape{static_cast<hsize_t>(map.height), static_cast<hsize_t>(map.width), 2};
  const Hdf5Handle space(H5Screate_simple(3, shape.data(), nullptr), H5Sclose, place);
  const Hdf5Handle options(H5Pcreate(H5P_DATASET_CREATE), H5Pclose, place);
  require_hdf5(H5Pset_obj_track_times(options, false), place);
  const Hdf5Handle list(H5Dcreate2(open, "rectify_map", H5T_NATIVE_FLOAT, space, H5P_DEFAULT, options, H5P_DEFAULT),
                        H5Dclose, place);
  require_hdf5(H5Dwrite(list, H5T_NATIVE_FLOAT, H5S_ALL, H5S_ALL, H5P_DEFAULT, map.pixels.data()), place);
}

std::string timestamps_text(const dataset::Dataset& dataset) {
  std::string text;
  for (const dataset::Frame& frame : dataset.frames) text += std::to_string(std::llround(frame.time_s * 1e6)) + "\n";
  return text;
}

/// A sequence of one or two cameras.
void write_sequence(const std::vector<const RigCamera*>& cameras, const fs::path& folder, const Progress& progress) {
  const std::array<const char*, 2> sides{"left", "right"};
  const imaging::Camera rectified = rectified_camera(cameras.front()->dataset.calibration.camera);
  std::array<Mat3, 2> rotations{Mat3::Identity(), Mat3::Identity()};
  if (cameras.size() > 1)
    rotations = rectifying_rotations(cameras[0]->T_body_camera.inverse() * cameras[1]->T_body_camera);
  base::make_folder(folder / "calibration");
  for (std::size_t side = 0; side < cameras.size(); ++side) {
    const dataset::Dataset& of_side = cameras[side]->dataset;
    const fs::path events = folder / "events" / sides[side];
    base::make_folder(events);
    fs::copy_file(events_of(*cameras[side]), events / "events.h5");
    write_rectify_map(events / "rectify_map.h5", rectify_map(of_side.calibration.camera, rectified, rotations[side]));
    imaging::write_kalibr(folder / "calibration" / (std::string(sides[side]) + ".yaml"), of_side.calibration);
    exports::write_png_frames(of_side, folder / "images" / sides[side] / "distorted", dataset::frame_id, progress);
  }
  base::write_file(folder / "images" / "timestamps.txt", timestamps_text(cameras.front()->dataset));
}

}  // namespace

imaging::Camera rectified_camera(const imaging::Camera& left) {
  Eigen::Matrix<double, 2, 3> d_pixel_d_point;
  const auto middle = left.project(Vec3::UnitZ(), d_pixel_d_point);
  if (!middle) throw InputError("camera", "sees nothing along its optical axis, so that it cannot be rectified");
  return {imaging::PinholeRadtan{.fx = std::abs(d_pixel_d_point(0, 0)),
                                 .fy = std::abs(d_pixel_d_point(1, 1)),
                                 .cx = middle->x(),
                                 .cy = middle->y(),
                                 .d = {}},
          left.width(), left.height()};
}

std::array<Mat3, 2> rectifying_rotations(const SE3& T_left_right) {
  const Vec3 along = T_left_right.translation;
  if (!(along.norm() > 0.0)) return {Mat3::Identity(), T_left_right.rotation.toRotationMatrix()};
  const Vec3 axes = Vec3::UnitZ() + T_left_right.rotation * Vec3::UnitZ();
  Mat3 R_left_rectified;
  const Vec3 x = (along.x() < 0.0 ? Vec3(-along) : along).normalized();
  const Vec3 y = axes.cross(x).normalized();
  R_left_rectified << x, y, x.cross(y);
  return {R_left_rectified.transpose(), R_left_rectified.transpose() * T_left_right.rotation.toRotationMatrix()};
}

imaging::Image<std::array<float, 2>> rectify_map(const imaging::Camera& camera, const imaging::Camera& rectified,
                                                 const Mat3& R_rectified_camera) {
  constexpr float kNone = std::numeric_limits<float>::quiet_NaN();
  imaging::Image<std::array<float, 2>> map(camera.width(), camera.height(), {kNone, kNone});
  for (int y = 0; y < camera.height(); ++y) {
    for (int x = 0; x < camera.width(); ++x) {
      const auto ray = camera.unproject(geometry::Vec2(x, y));
      if (!ray) continue;
      const auto pixel = rectified.project(R_rectified_camera * *ray);
      if (pixel) map(x, y) = {static_cast<float>(pixel->x()), static_cast<float>(pixel->y())};
    }
  }
  return map;
}

exports::ExportResult export_dsec(const dataset::Rig& rig, const fs::path& folder, bool replace,
                                  const Progress& progress, std::vector<fs::path> inputs) {
  std::vector<const RigCamera*> cameras = event_cameras(rig);
  for (const RigCamera& camera : rig.cameras) inputs.push_back(camera.dataset.folder);
  exports::ExportResult result{cameras.front()->dataset.frames.size(), {}};
  exports::note_reading_warnings(rig, result.notes);
  if (rig.cameras.size() > std::min<std::size_t>(2, cameras.size()))
    result.notes.emplace_back("DSEC's sequences have two event cameras at most: the first two with events are written");
  cameras.resize(std::min<std::size_t>(2, cameras.size()));
  result.notes.emplace_back("DSEC's layout has no place for true poses, IMU, positions and depth: they are left out");
  const base::OutputFolder output{
      .folder = folder, .command = "export", .replace = replace, .inputs = std::move(inputs)};
  base::write_folder(output, [&](const fs::path& temporary) { write_sequence(cameras, temporary, progress); });
  return result;
}

namespace {

constexpr hsize_t kChunk = hsize_t{1} << 16U;  // events
constexpr unsigned kDeflateLevel = 3;

/// A list that grows, of numbers of one type.
class GrowingList {
 public:
  GrowingList(hid_t parent, const char* name, hid_t type, std::string place) : place_(std::move(place)), type_(type) {
    const hsize_t none = 0, any = H5S_UNLIMITED, chunk = kChunk;
    const Hdf5Handle space(H5Screate_simple(1, &none, &any), H5Sclose, place_);
    const Hdf5Handle options(H5Pcreate(H5P_DATASET_CREATE), H5Pclose, place_);
    require_hdf5(H5Pset_chunk(options, 1, &chunk), place_);
    require_hdf5(H5Pset_shuffle(options), place_);
    require_hdf5(H5Pset_deflate(options, kDeflateLevel), place_);
    require_hdf5(H5Pset_obj_track_times(options, false), place_);  // no dates: the same bytes each time
    list_ = Hdf5Handle(H5Dcreate2(parent, name, type, space, H5P_DEFAULT, options, H5P_DEFAULT), H5Dclose, place_);
  }
  template <class Number>
  void append(const std::vector<Number>& numbers) {
    if (numbers.empty()) return;
    assert(H5Tget_size(type_) == sizeof(Number));
    const hsize_t count = numbers.size(), before = size_;
    size_ += count;
    require_hdf5(H5Dset_extent(list_, &size_), place_);
    const Hdf5Handle in_file(H5Dget_space(list_), H5Sclose, place_);
    require_hdf5(H5Sselect_hyperslab(in_file, H5S_SELECT_SET, &before, nullptr, &count, nullptr), place_);
    const Hdf5Handle in_memory(H5Screate_simple(1, &count, nullptr), H5Sclose, place_);
    require_hdf5(H5Dwrite(list_, type_, in_memory, in_file, H5P_DEFAULT, numbers.data()), place_);
  }
  void close() { list_.reset(); }

 private:
  std::string place_;
  hid_t type_;
  Hdf5Handle list_;
  hsize_t size_ = 0;
};

template <class Number>
std::vector<Number> values_of(const std::vector<Event>& events, Number Event::*value) {
  std::vector<Number> values(events.size());
  std::ranges::transform(events, values.begin(), value);
  return values;
}

/// A list of whole numbers in an open file.
template <class Number>
std::vector<Number> read_list(hid_t file, const char* name, hid_t type, std::uint64_t most, const std::string& place) {
  const Hdf5Handle list(H5Dopen2(file, name, H5P_DEFAULT), H5Dclose, place + ", " + name);
  const Hdf5Handle space(H5Dget_space(list), H5Sclose, place);
  const Hdf5Handle stored(H5Dget_type(list), H5Tclose, place);
  if (H5Sget_simple_extent_ndims(space) != 1 || H5Tget_class(stored) != H5T_INTEGER)
    throw InputError(place, std::string(name) + " is not a list of whole numbers, as DSEC's layout has it");
  const hssize_t count = H5Sget_simple_extent_npoints(space);
  if (count < 0 || static_cast<std::uint64_t>(count) > most)
    throw InputError(place, std::string(name) + " has more than " + std::to_string(most) + " numbers");
  std::vector<Number> numbers(static_cast<std::size_t>(count));
  if (count > 0) require_hdf5(H5Dread(list, type, H5S_ALL, H5S_ALL, H5P_DEFAULT, numbers.data()), place);
  return numbers;
}

}  // namespace

struct DsecWriter::Impl {
  explicit Impl(const fs::path& path)
      : place(path.string()),
        file(H5Fcreate(path.c_str(), H5F_ACC_TRUNC, H5P_DEFAULT, H5P_DEFAULT), H5Fclose, place),
        events(make_group()),
        x(events, "x", H5T_NATIVE_UINT16, place),
        y(events, "y", H5T_NATIVE_UINT16, place),
        t(events, "t", H5T_NATIVE_UINT32, place),
        p(events, "p", H5T_NATIVE_UINT8, place) {}

  Hdf5Handle make_group() const {
    const Hdf5Handle options(H5Pcreate(H5P_GROUP_CREATE), H5Pclose, place);
    require_hdf5(H5Pset_obj_track_times(options, false), place);
    return {H5Gcreate2(file, "events", H5P_DEFAULT, options, H5P_DEFAULT), H5Gclose, place};
  }

  /// Writes what waits.
  void flush() {
    x.append(values_of(waiting, &Event::x));
    y.append(values_of(waiting, &Event::y));
    t.append(values_of(waiting, &Event::t_us));
    p.append(values_of(waiting, &Event::polarity));
    waiting.clear();
  }

  void add(const Event& event) {
    while (1000ULL * ms_to_idx.size() <= event.t_us) ms_to_idx.push_back(count);
    waiting.push_back(event);
    ++count;
    if (waiting.size() == kChunk) flush();
  }

  void write_offset(std::int64_t t_offset_us) const {
    const Hdf5Handle options(H5Pcreate(H5P_DATASET_CREATE), H5Pclose, place);
    require_hdf5(H5Pset_obj_track_times(options, false), place);
    const Hdf5Handle space(H5Screate(H5S_SCALAR), H5Sclose, place);
    const Hdf5Handle offset(H5Dcreate2(file, "t_offset", H5T_NATIVE_INT64, space, H5P_DEFAULT, options, H5P_DEFAULT),
                            H5Dclose, place);
    require_hdf5(H5Dwrite(offset, H5T_NATIVE_INT64, H5S_ALL, H5S_ALL, H5P_DEFAULT, &t_offset_us), place);
  }

  std::string place;
  Hdf5Handle file, events;
  GrowingList x, y, t, p;
  std::vector<Event> waiting{};
  std::vector<std::uint64_t> ms_to_idx{};
  std::uint64_t count = 0;
};

DsecWriter::DsecWriter(fs::path file) {
  const QuietHdf5 quiet;
  impl_ = std::make_unique<Impl>(file);
}

DsecWriter::~DsecWriter() = default;

void DsecWriter::add(std::span<const Event> events) {
  const QuietHdf5 quiet;
  for (const Event& event : events) impl_->add(event);
}

void DsecWriter::finish(std::int64_t t_offset_us, std::uint32_t end_us) {
  const QuietHdf5 quiet;
  impl_->flush();
  const std::size_t milliseconds = (std::size_t{end_us} + 999) / 1000 + 1;
  while (impl_->ms_to_idx.size() < milliseconds) impl_->ms_to_idx.push_back(impl_->count);
  GrowingList index(impl_->file, "ms_to_idx", H5T_NATIVE_UINT64, impl_->place);
  index.append(impl_->ms_to_idx);
  impl_->write_offset(t_offset_us);
  for (GrowingList* list : {&impl_->x, &impl_->y, &impl_->t, &impl_->p, &index}) list->close();
  impl_->events.reset();
  require_hdf5(H5Fflush(impl_->file, H5F_SCOPE_LOCAL), impl_->place);
  impl_->file.reset();
}

EventRecording read_dsec_file(const fs::path& file, std::uint64_t most_events) {
  const QuietHdf5 quiet;
  const std::string place = file.string();
  const Hdf5Handle open(H5Fopen(file.c_str(), H5F_ACC_RDONLY, H5P_DEFAULT), H5Fclose, place);
  const auto x = read_list<std::uint16_t>(open, "events/x", H5T_NATIVE_UINT16, most_events, place);
  const auto y = read_list<std::uint16_t>(open, "events/y", H5T_NATIVE_UINT16, most_events, place);
  const auto t = read_list<std::uint32_t>(open, "events/t", H5T_NATIVE_UINT32, most_events, place);
  const auto p = read_list<std::uint8_t>(open, "events/p", H5T_NATIVE_UINT8, most_events, place);
  if (x.size() != t.size() || y.size() != t.size() || p.size() != t.size())
    throw InputError(place, "events/x, y, t and p are not of one length");
  EventRecording recording;
  for (std::size_t i = 0; i < t.size(); ++i) recording.events.push_back({t[i], x[i], y[i], p[i]});
  constexpr std::uint64_t kMostMilliseconds = (std::uint64_t{1} << 32U) / 1000 + 2;
  recording.ms_to_idx = read_list<std::uint64_t>(open, "ms_to_idx", H5T_NATIVE_UINT64, kMostMilliseconds, place);
  const Hdf5Handle offset(H5Dopen2(open, "t_offset", H5P_DEFAULT), H5Dclose, place + ", t_offset");
  require_hdf5(H5Dread(offset, H5T_NATIVE_INT64, H5S_ALL, H5S_ALL, H5P_DEFAULT, &recording.t_offset_us), place);
  return recording;
}

}  // namespace tileflight::events
