// Accuracy and speed of the odometry on whole sequences.
//
//   odometry_benchmark [--runs N] [--threads N] [--loop-closure] [--fixed-intrinsics] [--digest] [--set NAME=VALUE]
//                      [PART-OF-A-NAME...]
//
// `--digest`: a number of all bits of path and map, to see whether a change of the program changes any.
// `begin`: images read until there is a map; `first`: the first image with a pose, which may be one before.
// --set changes an option for an experiment; see kSettings. `synthetic` needs no data; other sequences are read from
// $TILEFLIGHT_TEST_DATA and skipped if missing. Processor time is that of all threads, without decoding of images,
// which has its own column.

#include <tbb/global_control.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cinttypes>
#include <cstdio>
#include <cstring>
#include <fstream>
#include <functional>
#include <limits>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "tests/test_data.h"
#include "tileflight/core/geometry/trajectory.h"
#include "tileflight/core/imaging/image_files.h"
#include "tileflight/data/dataset/dataset.h"
#include "tileflight/data/video/video.h"
#include "tileflight/slam/keyframes/synthetic_scene.h"
#include "tileflight/slam/odometry/odometry.h"
#include "tileflight/slam/odometry/stage_timer.h"

namespace {

namespace fs = std::filesystem;
using namespace tileflight;
using geometry::Vec3;
using imaging::RgbImage;

/// Images by index, with the true position of each camera (may be empty).
struct Sequence {
  imaging::Calibration calibration;
  std::size_t frames = 0;
  std::function<RgbImage(std::size_t)> picture;
  std::vector<Vec3> truth;
};

/// The images of a sequence to use, and their order.
struct Order {
  std::size_t from = 0;
  std::size_t to = std::numeric_limits<std::size_t>::max();  ///< exclusive
  std::size_t every = 1;
  bool reverse = false;
  int passes = 1;  ///< number of passes, alternating forwards and backwards

  std::vector<std::size_t> of(std::size_t frames) const {
    std::vector<std::size_t> indices;
    for (std::size_t i = from; i < std::min(frames, to); i += every) indices.push_back(i);
    if (reverse) std::reverse(indices.begin(), indices.end());
    const std::vector<std::size_t> once = indices;
    for (int pass = 1; pass < passes; ++pass) {
      if (pass % 2 == 0) indices.insert(indices.end(), once.begin(), once.end());
      if (pass % 2 == 1) indices.insert(indices.end(), once.rbegin(), once.rend());
    }
    return indices;
  }
};

struct Case {
  std::string name;
  std::function<std::optional<Sequence>()> load;
  Order order;
};

struct Outcome {
  odometry::OdometryResult result;
  std::size_t begin = 0;  ///< images read until there is a map
  double ate_m = -1.0;
  double path_m = 0.0;
  double decoding_s = 0.0;
  double processor_s = 0.0;  ///< without decoding
  double memory_mb = 0.0;    ///< peak of the run
};

fs::path data(const char* relative) { return tests::test_data_root() / relative; }

std::vector<Vec3> places(const std::optional<geometry::Trajectory>& trajectory) {
  std::vector<Vec3> out;
  if (trajectory) {
    for (const auto& pose : trajectory->poses) out.push_back(pose.T_local_camera.translation);
  }
  return out;
}

std::optional<Sequence> dataset_sequence(const char* relative) {
  if (!fs::exists(data(relative))) return std::nullopt;
  const dataset::Dataset read = dataset::read_dataset(data(relative));
  std::vector<Vec3> truth = places(read.groundtruth);
  if (truth.size() != read.frames.size()) truth.clear();
  const auto frames = read.frames;
  return Sequence{read.calibration, frames.size(),
                  [frames](std::size_t i) { return imaging::read_rgb(frames[i].image); }, truth};
}

RgbImage resized(const RgbImage& image, int width, int height) {
  RgbImage out(width, height);
  for (int y = 0; y < height; ++y) {
    const double v = std::clamp((y + 0.5) * image.height / height - 0.5, 0.0, image.height - 1.001);
    const int iy = static_cast<int>(v);
    for (int x = 0; x < width; ++x) {
      const double u = std::clamp((x + 0.5) * image.width / width - 0.5, 0.0, image.width - 1.001);
      const int ix = static_cast<int>(u);
      for (int c = 0; c < 3; ++c) {
        const double top = image(ix, iy)[c] * (1 - u + ix) + image(ix + 1, iy)[c] * (u - ix);
        const double bottom = image(ix, iy + 1)[c] * (1 - u + ix) + image(ix + 1, iy + 1)[c] * (u - ix);
        out(x, y)[c] = static_cast<std::uint8_t>(top * (1 - v + iy) + bottom * (v - iy) + 0.5);
      }
    }
  }
  return out;
}

/// The surrogate video, decoded once; if `width` differs from its own, resized together with its camera.
std::optional<Sequence> machangara(int width, std::size_t most) {
  const fs::path folder = data("flights/machangara-a");
  if (!fs::exists(folder)) return std::nullopt;
  imaging::Calibration calibration = imaging::read_calibration(folder / "camera.yaml");
  const int height = width * calibration.camera.height() / calibration.camera.width() / 2 * 2;
  auto images = std::make_shared<std::vector<RgbImage>>();
  video::read_video(folder / "video.mp4", {}, [&](std::int64_t, double, const RgbImage& image) {
    images->push_back(width == image.width ? image : resized(image, width, height));
    return images->size() < most;
  });
  if (width != calibration.camera.width()) {
    const double sx = static_cast<double>(width) / calibration.camera.width();
    const double sy = static_cast<double>(height) / calibration.camera.height();
    auto model = calibration.camera.model();
    std::visit(
        [&](auto& m) {
          m.fx *= sx;
          m.fy *= sy;
          m.cx = (m.cx + 0.5) * sx - 0.5;
          m.cy = (m.cy + 0.5) * sy - 0.5;
        },
        model);
    calibration.camera = imaging::Camera(model, width, height);
  }
  return Sequence{calibration, images->size(), [images](std::size_t i) { return (*images)[i]; },
                  places(geometry::read_tum(folder / "groundtruth.txt"))};
}

/// Hilly ground through a wide lens; rendered here.
std::optional<Sequence> synthetic() {
  constexpr int kFrames = 90;
  keyframes::test_support::Relief relief;
  relief.height_m = [](double x, double y) { return 2.0 * std::sin(0.15 * x) * std::cos(0.12 * y); };
  relief.highest_m = 2.0;
  relief.texel_m = 0.5;
  const imaging::Camera camera = imaging::make_fisheye(640, 400, 140.0);
  const keyframes::test_support::ReliefCamera scene(camera, relief);
  auto images = std::make_shared<std::vector<RgbImage>>();
  Sequence sequence;
  sequence.calibration.camera = camera;
  for (int i = 0; i < kFrames; ++i) {
    const double s = i / 30.0;
    const auto pose = keyframes::test_support::look_along(Vec3(4.0 * s, 5.0 * s, 20.0 + 0.5 * std::sin(s)),
                                                          Vec3(0.3 * std::sin(0.7 * s), 1.0, -1.0));
    images->push_back(scene.render(pose));
    sequence.truth.push_back(pose.translation);
  }
  sequence.frames = images->size();
  sequence.picture = [images](std::size_t i) { return (*images)[i]; };
  return sequence;
}

/// A drive along a valley with two turns, looking ahead; rendered here. `speed_m` of a picture.
std::optional<Sequence> drive(double speed_m) {
  constexpr int kFrames = 60;
  keyframes::test_support::Relief relief;
  relief.height_m = [](double x, double y) {
    return 4.0 + 4.0 * std::sin(0.21 * x + 1.0) * std::cos(0.17 * y) + 0.7 * std::sin(0.9 * x) * std::sin(0.8 * y);
  };
  relief.highest_m = 9.0;
  relief.texel_m = 0.4;
  const imaging::Camera camera = imaging::make_pinhole(640, 260, 82.0);
  const keyframes::test_support::ReliefCamera scene(camera, relief);
  auto images = std::make_shared<std::vector<RgbImage>>();
  Sequence sequence;
  sequence.calibration.camera = camera;
  Vec3 position(0, 0, 10.5);
  for (int i = 0; i < kFrames; ++i) {
    // A junction at pictures 4 to 16 and one at 34 to 46: 60 degrees each.
    const auto turned = [i](int from) { return std::clamp((i - from) / 12.0, 0.0, 1.0) * 1.05; };
    const double heading = turned(4) - turned(34);
    const Vec3 ahead(std::sin(heading), std::cos(heading), -0.12);
    const auto pose = keyframes::test_support::look_along(position, ahead);
    images->push_back(scene.render(pose));
    sequence.truth.push_back(position);
    position += speed_m * Vec3(ahead.x(), ahead.y(), 0.0);
  }
  sequence.frames = images->size();
  sequence.picture = [images](std::size_t i) { return (*images)[i]; };
  return sequence;
}

/// Keeps a sequence loaded while consecutive cases use it.
template <class Load>
std::function<std::optional<Sequence>()> once(const Load& load) {
  auto kept = std::make_shared<std::optional<std::optional<Sequence>>>();
  return [kept, load] {
    if (!*kept) *kept = load();
    return **kept;
  };
}

std::vector<Case> all_cases() {
  constexpr std::size_t kAll = 100000;
  std::vector<Case> cases;
  cases.push_back({"synthetic", once(synthetic), {}});
  const auto rooms = once([] { return dataset_sequence("sequences/seven_scenes_500"); });
  cases.push_back({"seven_scenes_500", rooms, {}});
  cases.push_back({"seven_scenes_500/reversed", rooms, {.reverse = true}});
  cases.push_back({"seven_scenes_500/every2", rooms, {.every = 2}});
  for (const std::size_t from : {5U, 10U, 15U, 20U, 25U, 100U}) {
    cases.push_back({"seven_scenes_500/from" + std::to_string(from), rooms, {.from = from}});
  }
  for (const std::size_t from : {0U, 100U, 200U, 300U}) {
    for (const bool reverse : {false, true}) {
      cases.push_back({"rooms/" + std::to_string(from) + "-" + std::to_string(from + 200) + (reverse ? "r" : ""),
                       rooms,
                       {.from = from, .to = from + 200, .reverse = reverse}});
      cases.push_back(
          {"rooms/" + std::to_string(from) + "-" + std::to_string(from + 200) + "/every2" + (reverse ? "r" : ""),
           rooms,
           {.from = from, .to = from + 200, .every = 2, .reverse = reverse}});
    }
  }
  const auto kitti = once([] { return dataset_sequence("sequences/kitti_seq1_51frames"); });
  cases.push_back({"kitti_seq1_51frames", kitti, {}});
  cases.push_back({"kitti_seq1_51frames/reversed", kitti, {.reverse = true}});
  for (const std::size_t from : {0U, 8U, 16U, 24U, 30U}) {
    for (const bool reverse : {false, true}) {
      cases.push_back({"kitti_part/" + std::to_string(from) + "-" + std::to_string(from + 20) + (reverse ? "r" : ""),
                       kitti,
                       {.from = from, .to = from + 20, .reverse = reverse}});
    }
  }
  cases.push_back({"kitti_every2", kitti, {.every = 2}});
  cases.push_back({"kitti_every2r", kitti, {.every = 2, .reverse = true}});
  for (const double speed_m : {0.25, 0.5, 1.0}) {
    const auto turns = once([speed_m] { return drive(speed_m); });
    const std::string name = "drive/" + std::to_string(speed_m).substr(0, 4);
    cases.push_back({name, turns, {}});
    cases.push_back({name + "/reversed", turns, {.reverse = true}});
    cases.push_back({name + "/from20", turns, {.from = 20}});
    cases.push_back({name + "/every2", turns, {.every = 2}});
  }
  cases.push_back({"euroc_V1_01_static", once([] { return dataset_sequence("sequences/euroc_V1_01_static"); }), {}});
  const auto flight = once([] { return machangara(1008, kAll); });
  for (const std::size_t from : {0U, 60U, 150U, 240U, 330U}) {
    cases.push_back({"machangara-a/from" + std::to_string(from), flight, {.from = from}});
  }
  cases.push_back({"machangara-a/reversed", flight, {.reverse = true}});
  cases.push_back({"machangara-a/every2", flight, {.every = 2}});
  cases.push_back({"machangara-a/every3", flight, {.every = 3}});
  for (const int passes : {1, 2, 4, 8}) {
    cases.push_back(
        {"length/" + std::to_string(passes) + "x300", once([] { return machangara(1008, 300); }), {.passes = passes}});
  }
  for (const int width : {504, 1344, 2016, 2688}) {
    cases.push_back({"size/" + std::to_string(width), once([width] { return machangara(width, 120); }), {}});
  }
  return cases;
}

/// RMS distance from the truth after alignment by the best similarity.
void score(const Sequence& sequence, const std::vector<std::size_t>& indices, Outcome& outcome) {
  const auto& poses = outcome.result.trajectory.poses;
  if (sequence.truth.empty() || poses.size() < 3) return;
  Eigen::Matrix3Xd from(3, poses.size()), to(3, poses.size());
  for (std::size_t i = 0; i < poses.size(); ++i) {
    from.col(i) = poses[i].T_local_camera.translation;
    to.col(i) = sequence.truth.at(indices.at(static_cast<std::size_t>(std::lround(poses[i].time_s))));
    if (i > 0) outcome.path_m += (to.col(i) - to.col(i - 1)).norm();
  }
  const Eigen::Matrix4d T = Eigen::umeyama(from, to, true);
  const Eigen::Matrix3Xd moved = (T.topLeftCorner<3, 3>() * from).colwise() + T.topRightCorner<3, 1>();
  outcome.ate_m = std::sqrt((moved - to).colwise().squaredNorm().mean());
}

/// Peak resident size since the last reset, MB (Linux; 0 elsewhere).
void reset_peak_memory() { std::ofstream("/proc/self/clear_refs") << "5"; }
double peak_memory_mb() {
  std::ifstream status("/proc/self/status");
  for (std::string line; std::getline(status, line);) {
    if (line.rfind("VmHWM:", 0) == 0) return std::stod(line.substr(6)) / 1024.0;
  }
  return 0.0;
}
double memory_mb() {
  std::ifstream status("/proc/self/status");
  for (std::string line; std::getline(status, line);) {
    if (line.rfind("VmRSS:", 0) == 0) return std::stod(line.substr(6)) / 1024.0;
  }
  return 0.0;
}

Outcome run(const Sequence& sequence, const Order& order, const odometry::OdometryOptions& options) {
  Outcome outcome;
  const std::vector<std::size_t> indices = order.of(sequence.frames);
  std::size_t next = 0;
  const odometry::FrameSource source = [&]() -> std::optional<odometry::InputFrame> {
    if (next == indices.size()) return std::nullopt;
    const std::size_t i = indices[next];
    // The time is the position in the order, by which the score finds the true position.
    const auto time = static_cast<double>(next);
    return odometry::InputFrame{.index = static_cast<std::int64_t>(next++),
                                .time_s = time,
                                .image = odometry::time_stage(outcome.decoding_s, [&] { return sequence.picture(i); })};
  };
  reset_peak_memory();
  const double memory_before_mb = memory_mb(), begin_s = odometry::cpu_time_s();
  odometry::Odometry odometry(sequence.calibration, options);
  while (!odometry.lost()) {
    auto frame = source();
    if (!frame) break;
    const bool tracked = odometry.add(std::move(*frame)).status == odometry::FrameStatus::kTracked;
    if (tracked && outcome.begin == 0) outcome.begin = next;
  }
  outcome.result = odometry.finish();
  outcome.processor_s = odometry::cpu_time_s() - begin_s - outcome.decoding_s;
  outcome.memory_mb = peak_memory_mb() - memory_before_mb;
  score(sequence, indices, outcome);
  return outcome;
}

void print_header() {
  std::printf("%-30s %9s %5s %5s %8s %8s | %6s %6s | %6s %6s %6s %6s %6s %6s | %6s %5s %6s\n", "sequence", "tracked",
              "begin", "first", "ATE m", "% path", "CPU ms", "decode", "start", "pict", "track", "trace", "keyfr",
              "focal", "fps", "keyf", "MB");
}

void print_intrinsics(const imaging::Camera& camera) {
  std::visit([](const auto& m) { std::printf("%30s fx %.2f fy %.2f cx %.2f cy %.2f\n", "", m.fx, m.fy, m.cx, m.cy); },
             camera.model());
}

/// FNV-1a over the bits of path and map.
std::uint64_t digest(const odometry::OdometryResult& result) {
  std::uint64_t hash = 14695981039346656037ULL;
  const auto add = [&hash](const double* values, int count) {
    for (int i = 0; i < count; ++i) {
      std::uint64_t bits = 0;
      std::memcpy(&bits, values + i, sizeof(bits));
      hash = (hash ^ bits) * 1099511628211ULL;
    }
  };
  for (const auto& pose : result.trajectory.poses) {
    add(pose.T_local_camera.translation.data(), 3);
    add(pose.T_local_camera.rotation.coeffs().data(), 4);
  }
  for (const Vec3& point : result.map.positions) add(point.data(), 3);
  return hash;
}

void print(const std::string& name, const Outcome& outcome, const odometry::OdometryOptions& options) {
  const auto& r = outcome.result;
  const double frames = std::max<double>(1.0, static_cast<double>(r.frames));
  const auto ms = [frames](double s) { return 1e3 * s / frames; };
  const odometry::StageTimes& cpu = r.cpu_time;
  const auto& poses = r.trajectory.poses;
  const long first = poses.empty() ? -1 : std::lround(poses.front().time_s);
  std::printf(
      "%-30s %4lld/%-4lld %5zu %5ld %8.4f %8.4f | %6.2f %6.2f | %6.2f %6.2f %6.2f %6.2f %6.2f %6.2f | %6.1f %5zu "
      "%6.0f%s%s\n",
      name.c_str(), static_cast<long long>(r.frames_tracked), static_cast<long long>(r.frames), outcome.begin, first,
      outcome.ate_m, outcome.path_m > 0 ? 100.0 * outcome.ate_m / outcome.path_m : 0.0, ms(outcome.processor_s),
      ms(outcome.decoding_s), ms(cpu.initialization), ms(cpu.preprocessing), ms(cpu.tracking), ms(cpu.tracing),
      ms(cpu.keyframes), ms(cpu.focal_changes), frames / r.wall_time_s, r.keyframes.size(), outcome.memory_mb,
      r.lost ? "  " : "", r.lost ? r.lost_reason.c_str() : "");
  if (options.window.refine_intrinsics && r.camera) print_intrinsics(*r.camera);
  std::fflush(stdout);
}

/// Options that --set changes.
bool set_option(const std::string& text, odometry::OdometryOptions& options) {
  const std::map<std::string, double*> kSettings{
      {"min_parallax_rad", &options.initialization.min_parallax_rad},
      {"fallback_parallax_rad", &options.initialization.fallback_parallax_rad},
      {"sufficient_parallax_rad", &options.initialization.sufficient_parallax_rad},
      {"max_cost_ratio", &options.initialization.max_cost_ratio},
      {"max_median_residual_px", &options.initialization.max_median_residual_px},
      {"buffer_mb", &options.initialization.buffer_mb},
      {"keyframe_flow_share", &options.window.keyframe_flow_share},
      {"keyframe_log_brightness", &options.window.keyframe_log_brightness},
      {"marginal_weight", &options.window.marginal_weight},
      {"focal_sigma", &options.window.focal_sigma},
      {"principal_point_sigma", &options.window.principal_point_sigma}};
  const std::size_t equals = text.find('=');
  const auto setting = kSettings.find(text.substr(0, equals));
  if (equals == std::string::npos || setting == kSettings.end()) return false;
  *setting->second = std::stod(text.substr(equals + 1));
  return true;
}

}  // namespace

int main(int argc, char** argv) {
  int runs = 1;
  bool with_digest = false;
  std::optional<tbb::global_control> limit;
  std::vector<std::string> wanted;
  odometry::OdometryOptions options;
  for (int i = 1; i < argc; ++i) {
    if (std::strcmp(argv[i], "--runs") == 0 && i + 1 < argc) {
      runs = std::stoi(argv[++i]);
    } else if (std::strcmp(argv[i], "--threads") == 0 && i + 1 < argc) {
      limit.emplace(tbb::global_control::max_allowed_parallelism, std::stoul(argv[++i]));
    } else if (std::strcmp(argv[i], "--set") == 0 && i + 1 < argc) {
      if (!set_option(argv[++i], options)) {
        std::fprintf(stderr, "odometry_benchmark: no option %s\n", argv[i]);
        return 1;
      }
    } else if (std::strcmp(argv[i], "--loop-closure") == 0) {
      options.loops.enabled = true;
    } else if (std::strcmp(argv[i], "--digest") == 0) {
      with_digest = true;
    } else if (std::strcmp(argv[i], "--fixed-intrinsics") == 0) {
      options.window.refine_intrinsics = false;
    } else {
      wanted.emplace_back(argv[i]);
    }
  }
  print_header();
  for (Case& c : all_cases()) {
    const bool chosen = wanted.empty() || std::any_of(wanted.begin(), wanted.end(), [&](const std::string& part) {
                          return c.name.find(part) != std::string::npos;
                        });
    if (!chosen) continue;
    const std::optional<Sequence> sequence = c.load();
    if (!sequence) {
      std::printf("%-30s no data\n", c.name.c_str());
      continue;
    }
    for (int i = 0; i < runs; ++i) {
      const Outcome outcome = run(*sequence, c.order, options);
      print(c.name, outcome, options);
      if (with_digest) std::printf("%30s digest %016" PRIx64 "\n", "", digest(outcome.result));
    }
  }
  return 0;
}
