#include "tileflight/experiment/dataset_film.h"

#include <algorithm>
#include <map>
#include <mutex>
#include <numeric>

#include "tileflight/dataset/attitude_csv.h"
#include "tileflight/dataset/encode_queue.h"
#include "tileflight/dataset/video.h"
#include "tileflight/experiment/extract.h"
#include "tileflight/experiment/flight_faults.h"
#include "tileflight/experiment/memory_budget.h"
#include "tileflight/experiment/output_files.h"
#include "tileflight/experiment/require_surface.h"
#include "tileflight/experiment/version.h"
#include "tileflight/geometry/files.h"
#include "tileflight/geometry/input_error.h"
#include "tileflight/imaging/photometric.h"
#include "tileflight/scene/scene.h"
#include "tileflight/sensors/gps.h"
#include "tileflight/tiles/open_source.h"

namespace tileflight::experiment {
namespace fs = std::filesystem;
namespace {

/// What a receiver would have said along the path, where the place is on the earth.
std::vector<dataset::GpsFix> simulated_gps(const Mission& mission, const std::optional<geometry::LocalFrame>& frame,
                                           std::uint64_t seed) {
  if (!frame || mission.frames.size() < 2) return {};
  std::vector<dataset::GpsFix> fixes;
  const sensors::GnssOptions options = mission.sensor_files->suite().gnss.value_or(sensors::GnssOptions{.seed = seed});
  for (const sensors::PositionFix& fix : sensors::simulate_gnss(mission.frames, options)) {
    fixes.push_back(
        {fix.time_s, frame->geodetic_from_local(fix.position), fix.horizontal_sigma_m, fix.vertical_sigma_m});
  }
  return fixes;
}

/// What a gimbal would have said of the camera's attitude, where the place is on the earth.
std::vector<dataset::CameraAttitude> simulated_attitude(const Mission& mission,
                                                        const std::optional<geometry::LocalFrame>& frame,
                                                        std::uint64_t seed) {
  if (!frame || mission.frames.size() < 2) return {};
  const sensors::AttitudeOptions options =
      mission.sensor_files->suite().attitude.value_or(sensors::AttitudeOptions{.seed = seed});
  const auto times = sensors::sample_times("attitude", mission.frames.poses.front().time_s,
                                           mission.frames.poses.back().time_s, options.rate_hz);
  const auto pose_at = [&](double time_s) { return *geometry::interpolate(mission.frames, time_s); };
  std::vector<dataset::CameraAttitude> attitudes;
  for (const sensors::AttitudeSample& sample : sensors::simulate_attitude(pose_at, times, options))
    attitudes.push_back(
        {sample.time_s, sample.R_local_camera, sensors::tilt_sigma_deg(options), sensors::yaw_sigma_deg(options)});
  return attitudes;
}

std::string joined(const std::vector<std::string>& lines) {
  return std::accumulate(lines.begin(), lines.end(), std::string(), [](std::string text, const std::string& line) {
    return text + (text.empty() ? "" : "; ") + line;
  });
}

std::map<std::string, std::string> description(const RenderSettings& settings, const tiles::LoadedTiles& tiles) {
  return {{"made_by", "tileflight render " + version()},
          {"source", tiles::shown_source(settings.source)},
          {"flight", settings.flight.flight.string()},
          {"seed", std::to_string(settings.seed)},
          {"cut_sha256", tiles.cut_hash},
          {"tiles", std::to_string(tiles.cut_size - tiles.tiles_failed)},
          {"attribution", joined(tiles.attribution)},
          {"terms_provider", tiles.terms.provider},
          {"terms_accepted", settings.load.source.terms_accepted ? "true" : "false"}};
}

/// Frames come from several threads in any order; a video wants them one after the other.
class InOrder {
 public:
  explicit InOrder(std::function<void(const imaging::RgbImage&)> take) : take_(std::move(take)) {}

  void add(std::size_t index, const imaging::RgbImage& image) {
    const std::lock_guard lock(mutex_);
    waiting_.emplace(index, image);
    for (auto next = waiting_.find(next_); next != waiting_.end(); next = waiting_.find(next_)) {
      take_(next->second);
      waiting_.erase(next);
      ++next_;
    }
  }

 private:
  std::function<void(const imaging::RgbImage&)> take_;
  std::mutex mutex_;
  std::map<std::size_t, imaging::RgbImage> waiting_;
  std::size_t next_ = 0;
};

void add_distinct(const std::vector<std::string>& from, std::vector<std::string>& to) {
  for (const std::string& text : from) {
    if (std::find(to.begin(), to.end(), text) == to.end()) to.push_back(text);
  }
}

void add_part(const sensors::FlightReport& report, const tiles::LoadedTiles& tiles, Filmed& filmed) {
  tiles::LoadedTiles& all = filmed.tiles;
  all.local_frame = tiles.local_frame;
  all.region = tiles.region;
  all.terms = tiles.terms;
  all.cut_hash = tiles.cut_hash;
  all.cut_size = tiles.cut_size;
  all.complete = tiles.complete && (filmed.parts == 0 || all.complete);
  all.tiles_failed = std::max(all.tiles_failed, tiles.tiles_failed);
  all.triangles = std::max(all.triangles, tiles.triangles);
  add_distinct(tiles.attribution, all.attribution);
  add_distinct(tiles.warnings, all.warnings);
  filmed.exposure_after = report.exposure_after;
  filmed.seconds += report.seconds;
  ++filmed.parts;
}

/// What the output `visibility` is about.
sensors::PlaceTest scored_place(const RenderSettings& settings, const tiles::Region& region) {
  if (settings.scored) {
    return [box = *settings.scored](const geometry::Vec3& point) { return box.contains(point); };
  }
  const tiles::LoadOptions& load = settings.load;
  if (!load.center && !load.center_local && !load.size && load.areas.empty()) return {};
  return [region](const geometry::Vec3& point) {
    return region.box().contains(point) &&
           (region.parts.empty() ||
            std::ranges::any_of(region.parts, [&](const auto& part) { return geometry::contains(part, point); }));
  };
}

/// Loads what a flight looks at and renders it, in as many parts as memory wants.
class Filming {
 public:
  Filming(const Mission& mission, const RenderSettings& settings, const Progress& progress)
      : mission_(mission),
        settings_(settings),
        progress_(progress),
        source_(tiles::open_source(settings.source, settings.load.source)),
        load_(settings.load) {
    load_.uses = {tiles::Use::kAnalyse};
    load_.max_memory_bytes = settings.max_memory_bytes.value_or(default_memory_bytes());
    if (settings.error_px) load_.flight = {eyes_of(mission), *settings.error_px, {}};
  }

  /// Frames of `share` go to `sink`; when it returns, a frame's files are written. `folder`: of the dataset, for what
  /// its other sensors say.
  Filmed run(const fs::path& folder, FrameShare& share, const sensors::FrameSink& sink) {
    Filmed filmed;
    bool any_surface = false, any_points = false;
    const std::size_t frames = mission_.frames.size();
    for (std::size_t begin = 0, count = frames; begin < frames; begin += count) {
      tiles::LoadedTiles tiles = load(begin, count);
      if (begin == 0) share.set_cut(tiles.cut_hash);
      any_surface = any_surface || !tiles.meshes.empty();
      any_points = any_points || tiles.points > 0;
      if (count == frames) require_surface(tiles.meshes, any_points, tiles::shown_source(settings_.source));
      const scene::Scene scene(or_nothing(std::move(tiles.meshes)), anchor());
      sensors::FlightOptions options = mission_.options;
      options.first_frame = begin;
      options.end_frame = begin + count;
      if (tiles.local_frame) options.origin = tiles.local_frame->origin();
      options.place = scored_place(settings_, tiles.region);
      options.exposure_before = filmed.exposure_after;
      if (share.kept() != nullptr) options.wanted = [&share](std::size_t index) { return share.is_mine(index); };
      if (share.is_first()) {
        mission_.sensor_files->record(scene, tiles.local_frame, begin, begin + count, folder);
      }
      const auto take = [&](const sensors::SensedFrame& frame) {
        sink(frame);
        share.add(frame);
      };
      add_part(sensors::render_flight(scene, mission_.calibration.camera, mission_.frames, mission_.pose_at, options,
                                      take, progress_),
               tiles, filmed);
    }
    if (!any_surface) require_surface({}, any_points, tiles::shown_source(settings_.source));
    return filmed;
  }

 private:
  /// The same for all parts of a flight, so that they see the same surfaces to the last bit.
  geometry::Vec3 anchor() const { return mission_.frames.poses[mission_.frames.size() / 2].T_local_camera.translation; }

  /// Tiles for `count` frames from `begin` on, or for half of them, and so on, until they fit.
  tiles::LoadedTiles load(std::size_t begin, std::size_t& count) {
    count = std::min(count, mission_.frames.size() - begin);
    while (true) {
      if (load_.flight) {
        const std::size_t eyes_a_frame = load_.flight->eyes.size() / mission_.frames.size();
        load_.flight->part = {begin * eyes_a_frame, (begin + count) * eyes_a_frame};
      }
      try {
        return tiles::load_region(*source_, tiles::shown_source(settings_.source), load_, progress_);
      } catch (const tiles::MemoryExceeded&) {
        if (!load_.flight || count == 1) throw;
        count = (count + 1) / 2;
      }
    }
  }

  const Mission& mission_;
  const RenderSettings& settings_;
  const Progress& progress_;
  std::unique_ptr<tiles::TileSource> source_;
  tiles::LoadOptions load_;
};

/// What undoes the camera's response and vignetting.
void write_photometric(const Mission& mission, const fs::path& folder) {
  const imaging::Camera& camera = mission.calibration.camera;
  const imaging::PhotometricCalibration calibration =
      sensors::photometric_calibration(mission.options.formation, camera.width(), camera.height());
  imaging::write_pcalib(folder / "pcalib.txt", calibration.inverse_response);
  if (!calibration.vignette.empty()) imaging::write_vignette(folder / "vignette.png", calibration.vignette);
}

/// What a dataset holds beside frames and their outputs.
void add_lists(dataset::DatasetWriter& writer, const Mission& mission, const RenderSettings& settings,
               const Filmed& filmed, const std::vector<KeptFrame>& frames) {
  if (settings.flight.outputs.photometric) write_photometric(mission, writer.temporary_folder());
  writer.set_groundtruth(mission.frames);
  const std::vector<dataset::GpsFix> gps = simulated_gps(mission, filmed.tiles.local_frame, settings.seed);
  if (!gps.empty()) writer.set_gps(gps);
  const auto attitudes = simulated_attitude(mission, filmed.tiles.local_frame, settings.seed);
  if (!attitudes.empty()) dataset::write_attitude_csv(writer.temporary_folder() / "attitude.csv", attitudes);
  for (const auto& [key, value] : description(settings, filmed.tiles)) writer.describe(key, value);
  const std::optional<geometry::LocalFrame>& frame = filmed.tiles.local_frame;
  for (const auto& [key, value] : described_frame(frame ? std::optional(frame->origin()) : std::nullopt))
    writer.describe(key, value);
  const auto faults = sensors::flight_faults(checks_of(frames), 0, mission.options.clearance_m);
  for (const auto& [key, value] : described_faults(faults)) writer.describe(key, value);
  if (const auto& light = mission.options.formation.light)
    writer.describe("light", described(daylight_at(*light, filmed.tiles.local_frame->origin())->sun()));
  mission.sensor_files->write(filmed.tiles.local_frame, mission.frames.poses.front().time_s, writer.temporary_folder());
  for (const auto& [key, value] : mission.sensor_files->description()) writer.describe(key, value);
  if (!mission.vehicle.is_null()) {
    geometry::write_file(writer.temporary_folder() / "vehicle.json", mission.vehicle.dump(2) + "\n");
  }
}

double frame_rate(const geometry::Trajectory& frames) {
  if (frames.size() < 2) return 30.0;
  return (static_cast<double>(frames.size()) - 1.0) / (frames.poses.back().time_s - frames.poses.front().time_s);
}

/// The video's clock starts with its first picture.
geometry::Trajectory on_video_clock(geometry::Trajectory frames) {
  const double start_s = frames.poses.front().time_s;
  for (geometry::StampedPose& pose : frames.poses) pose.time_s -= start_s;
  return frames;
}

/// The video's pictures as the dataset's frames.
void add_decoded(const fs::path& video, const geometry::Trajectory& frames, const std::vector<double>& exposures_ms,
                 dataset::DatasetWriter& writer) {
  dataset::EncodeQueue queue(writer);
  dataset::read_video(video, {}, [&](std::int64_t index, double, const imaging::RgbImage& image) {
    const auto i = static_cast<std::size_t>(index);
    queue.add(i, frames.poses[i].time_s, exposures_ms[i], image);
    return true;
  });
  queue.finish();
}

}  // namespace

struct DatasetFilm::Impl {
  Impl(const Mission& mission, const RenderSettings& settings, const fs::path& out, bool replace, FrameShare& share,
       const Progress& progress)
      : mission_(mission),
        settings_(settings),
        share_(share),
        filming_(mission_, settings, progress),
        writer_(out, mission.calibration,
                {.replace = replace,
                 .command = "render",
                 .inputs = files_read(settings),
                 .png = settings.png,
                 .build_in = share.build_folder()}),
        outputs_(writer_.temporary_folder(), settings.flight.outputs, share.runs_folder()),
        in_order_([this](const imaging::RgbImage& image) { video_->add(image); }) {
    if (settings.flight.video && share.is_first()) {
      const imaging::Camera& camera = mission.calibration.camera;
      video_.emplace(
          video_file(), camera.width(), camera.height(),
          dataset::VideoOptions{.frames_per_second = frame_rate(mission.frames), .rate = *settings.flight.video});
    }
  }

  /// This process's frames.
  void shoot() {
    filmed_ = filming_.run(writer_.temporary_folder(), share_, [&](const sensors::SensedFrame& frame) {
      outputs_.add(frame);
      if (!settings_.flight.video) {
        writer_.add_frame(frame.index, frame.time_s, frame.exposure_ms, frame.rgb);
      } else {
        if (share_.kept() != nullptr) share_.kept()->add_picture(frame.index, frame.rgb);
        if (share_.is_whole()) in_order_.add(frame.index, frame.rgb);
      }
    });
  }

  /// The whole, once every process has shot its frames; by the first one.
  std::vector<KeptFrame> finish() {
    const std::vector<KeptFrame> frames = share_.all();
    if (settings_.flight.video) through_video(frames);
    for (std::size_t i = 0; i < frames.size(); ++i) {
      writer_.add_written_frame(i, mission_.frames.poses[i].time_s, frames[i].exposure_ms);
    }
    outputs_.finish();
    add_lists(writer_, mission_, settings_, filmed_, frames);
    writer_.finish();
    return frames;
  }

  fs::path video_file() const { return writer_.temporary_folder() / "video.mp4"; }
  void through_video(const std::vector<KeptFrame>& frames) {
    for (std::size_t i = 0; !share_.is_whole() && i < frames.size(); ++i) video_->add(share_.kept()->picture(i));
    video_->finish();
    mission_.frames = on_video_clock(mission_.frames);
    std::vector<double> exposures_ms;
    for (const KeptFrame& frame : frames) exposures_ms.push_back(frame.exposure_ms);
    add_decoded(video_file(), mission_.frames, exposures_ms, writer_);
  }

  Mission mission_;
  const RenderSettings& settings_;
  FrameShare& share_;
  Filming filming_;
  dataset::DatasetWriter writer_;
  OutputFiles outputs_;
  std::optional<dataset::VideoWriter> video_;  ///< the first rank's
  InOrder in_order_;
  Filmed filmed_;
};

DatasetFilm::DatasetFilm(const Mission& mission, const RenderSettings& settings, const fs::path& out, bool replace,
                         FrameShare& share, const Progress& progress)
    : impl_(std::make_unique<Impl>(mission, settings, out, replace, share, progress)) {}

DatasetFilm::~DatasetFilm() = default;

void DatasetFilm::shoot() { impl_->shoot(); }

std::vector<KeptFrame> DatasetFilm::finish() { return impl_->finish(); }

const Filmed& DatasetFilm::filmed() const { return impl_->filmed_; }

}  // namespace tileflight::experiment
